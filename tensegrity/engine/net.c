/* Stages of a network; RUNS(X) lists the kinds of runs. */

#ifndef _WIN32
#include <sched.h>
#define REST sched_yield();
#else
#define REST
#endif
#if defined(__GNUC__) && defined(__SSE2__)
#define BREATH __builtin_ia32_pause(); /* yields the core to its other hardware thread */
#else
#define BREATH
#endif
#define PATIENCE 2000 /* spins at the barrier before the processor is yielded */

/* Barrier: wait until all threads are here. */
static void barrier(const scene *c)
{
    if (c->pieces == 1) return;
    integer *here = c->gate, *turn = c->gate + 8;
    const integer now = __atomic_load_n(turn, __ATOMIC_ACQUIRE);
    if (__atomic_add_fetch(here, 1, __ATOMIC_ACQ_REL) == c->pieces) {
        __atomic_store_n(here, 0, __ATOMIC_RELAXED);
        __atomic_store_n(turn, now + 1, __ATOMIC_RELEASE);
        return;
    }
    for (integer k = 0; __atomic_load_n(turn, __ATOMIC_ACQUIRE) == now; k++) {
        BREATH
        if (k > PATIENCE) { REST }
    }
}

/* The first site after a tile. */
static integer end(const scene *c, integer t)
{
    return t + 1 < c->tiles ? (t + 1) * TILE : c->sites;
}

/* The displacements shared by several threads: of this stage, or of the `next` one, as other
   threads still read those of this stage.  Two barriers end a stage. */
static real *common(const scene *c, integer next)
{
    const integer turn = __atomic_load_n(c->gate + 8, __ATOMIC_RELAXED) / 2;
    return c->near + (turn + next) % 2 * c->rows * DIM;
}

/* Copy the displacements of this thread's sites. */
static void copy(const scene *c, const real *restrict from, real *restrict to)
{
    const integer first = c->tile * TILE * DIM;
    if (c->tile < c->last_tile)
        EACH(end(c, c->last_tile - 1) * DIM - first) to[first + i] = from[first + i];
}

/* This thread's rows of forces on sites. */
static real *rows(const scene *c) { return c->pull + c->piece * c->sites * ROW; }

/* Initialise the forces on the sites of a tile with the constant ones. */
static void clear(const scene *c, integer t, real *restrict pull)
{
    const integer from = t * TILE, count = end(c, t) - from;
    EACH(count * ROW) pull[from * ROW + i] = 0;
    if (c->loaded)
        for (integer q = from; q < from + count; q++)
            AXES(k) pull[q * ROW + k] = c->load[q * DIM + k];
}

/* Whether a tile is at rest in this stage, and its contacts have no forces: until a site of its own
   or of a tile beside it moves, or a contact of these has a force.  No bit depends on this. */
static int rests(const scene *c, integer t)
{
    return c->active && __atomic_load_n(c->active + 1 + t, __ATOMIC_RELAXED) < *c->active;
}

/* Let a tile and those beside it move in the next stage. */
static void rouse(const scene *c, integer t)
{
    for (integer k = c->beside_at[t]; k < c->beside_at[t + 1]; k++)
        __atomic_store_n(c->active + 1 + c->beside[k], *c->active + 1, __ATOMIC_RELAXED);
}

#ifndef STEPPER
/* The mean elongation of the segments of each cable, which all of them then have, and the least of
   them: minus its length where a segment has turned by more than a right angle since the last
   stage, so that the steps do not resolve how close its ends passed each other. */
static void lengthen(const scene *c, const real *restrict u)
{
    for (integer q = 0; q < c->cables; q++) {
        const integer first = c->strand_at[q], last = c->strand_at[q + 1];
        real sum = 0, least = INFINITY;
        for (integer s = first; s < last; s++) {
            const real *restrict place = c->strand_geometry + s * (DIM + 2);
            const real length = place[DIM + 1];
            const integer p = c->strand[2 * s] * DIM, to = c->strand[2 * s + 1] * DIM;
            real w[DIM], along[DIM], r, turn = 0, *restrict before = c->toward + s * DIM;
            AXES(k) w[k] = u[to + k] - u[p + k];
            pair_contact(place, w, place[DIM], length, &r, along);
            AXES(k) {
                const real now = DIM > 1 ? place[k] + w[k] : place[k] * (length + r);
                turn += now * before[k], before[k] = now;
            }
            sum += r;
            least = smaller(turn < 0 ? -length : r, least);
        }
        c->average[2 * q] = sum / (last - first), c->average[2 * q + 1] = least;
        for (integer e = c->mean_at[q]; e < c->mean_at[q + 1]; e++) {
            c->mean[c->mean_entry[e]] = c->average[2 * q];
            c->least[c->mean_entry[e]] = least;
        }
    }
}

/* Add the forces of the contacts of a tile to its sites, and to others of higher numbers; returns
   whether any of them is not 0. */
static int contacts(const scene *c, const real *u, integer t, real *restrict pull)
{
    int felt = 0;
    for (integer s = 0; s < c->runs; s++) {
        if (c->law[s] & 2 && t < c->tile) continue;
        switch (c->law[s]) {
#define CASES(K, OWN)                                                                       \
    case 4 * K + OWN: felt |= pairs_##K##_##OWN(c, u, s, t, pull); break;                   \
    case 4 * K + 2 + OWN: felt |= walls_##K##_##OWN(c, u, s, t, pull); break;
            RUNS(CASES)
        }
    }
    return felt;
}

/* Forces on the walls, each the sum over its contacts in the order of the list. */
static const real *on_walls(const scene *c)
{
    real *restrict force = c->force;
    for (integer q = 0; q < c->rows - c->sites; q++) {
        real sum[DIM] = {0};
        for (integer b = c->pressed[q]; b < c->pressed[q + 1]; b++)
            AXES(k) sum[k] += c->press[c->pressing[b] + k * GROUP];
        AXES(k) force[q * DIM + k] = sum[k];
    }
    return force;
}

/* A kick by a and a drift by b of the sites of a tile, `from` some displacements `to` others;
   returns the largest velocity. */
static real move_tile(const scene *c, integer t, real a, real b, const real *restrict pull,
                      const real *from, real *to)
{
    const integer first = t * TILE * DIM, count = end(c, t) - t * TILE;
    const real *restrict w = c->w + first;
    real *restrict v = c->v + first, largest = 0;
    from += first, to += first, pull += t * TILE * ROW;
    pack fastest = wide(0);
    integer q = 0;
    for (; q + WIDE <= count; q += WIDE) {
        pack pulls[DIM];
        squeezed(pull + q * ROW, pulls);
        AXES(k) {
            const integer at = q * DIM + k * WIDE;
            const pack speed = load(v + at) + a * (load(w + at) * pulls[k]);
            store(v + at, speed);
            store(to + at, load(from + at) + b * speed);
            fastest = larger_of(magnitude(speed), fastest);
        }
    }
    for (; q < count; q++)
        AXES(k) {
            const integer at = q * DIM + k;
            v[at] += a * (w[at] * pull[q * ROW + k]);
            to[at] = from[at] + b * v[at];
            largest = larger(fabs(v[at]), largest);
        }
    LANES_OF(l) largest = larger(LANE(fastest, l), largest);
    return largest;
}

real stage(const scene *c, real a, real b)
{
    const integer moving = c->sites * DIM, all = c->rows * DIM;
    const real *u = c->pieces > 1 ? common(c, 0) : c->u;
    real *next = c->pieces > 1 ? common(c, 1) : c->u;
    real *restrict pull = rows(c), largest = 0;
    lengthen(c, u); /* one thread, and no tile rests */
    if (c->couplings) { /* all forces first: none rests, and there is one thread */
        for (integer t = 0; t < c->tiles; t++) contacts(c, u, t, pull);
        COUPLE(c, pull, ROW)
    }
    for (integer t = c->before; t < c->reach; t++) {
        if (rests(c, t)) continue;
        const int felt = !c->couplings && t < c->last_tile && contacts(c, u, t, pull);
        if (t >= c->tile && t < c->last_tile) {
            const real speed = move_tile(c, t, a, b, pull, u, next);
            if (c->active && (felt || speed > 0)) rouse(c, t);
            largest = larger(speed, largest);
        }
        clear(c, t, pull);
    }
    c->farthest[c->piece] = fabs(b) * largest;
    barrier(c);
    if (!c->piece) {
        for (integer k = 1; k < c->pieces; k++)
            *c->farthest = larger(*c->farthest, c->farthest[k]);
        *c->travel += *c->farthest;
        if (c->active) ++*c->active;
        const real *restrict force = on_walls(c);
        for (integer q = moving; q < all; q++) {
            c->v[q] += a * c->w[q] * force[q - moving];
            c->u[q] += b * c->v[q];
        }
    }
    barrier(c);
    return 0;
}

integer advance(const scene *c, const void *none, integer steps, integer opened); /* in steps.c */

/* The part of one of several threads in `advance`. */
void advance_together(const scene *c, integer steps, integer opened)
{
    copy(c, c->u, common(c, 1));
    barrier(c), barrier(c);
    advance(c, 0, steps, opened);
    copy(c, common(c, 0), c->u);
}
#endif
