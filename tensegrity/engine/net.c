/* Stages and accelerations of a network; RUNS(X) lists the kinds of runs. */

#ifndef _WIN32
#include <sched.h>
#define REST sched_yield();
#else
#define REST
#endif
#define PATIENCE 2000 /* looks at the gate before others get the processor */

/* Wait until all threads are here. */
static void meet(const scene *c)
{
    if (c->pieces == 1) return;
    integer *here = c->gate, *turn = c->gate + 8;
    const integer now = __atomic_load_n(turn, __ATOMIC_ACQUIRE);
    if (__atomic_add_fetch(here, 1, __ATOMIC_ACQ_REL) == c->pieces) {
        __atomic_store_n(here, 0, __ATOMIC_RELAXED);
        __atomic_store_n(turn, now + 1, __ATOMIC_RELEASE);
        return;
    }
    for (integer k = 0; __atomic_load_n(turn, __ATOMIC_ACQUIRE) == now; k++)
        if (k > PATIENCE) { REST }
}

/* The first site behind a tile. */
static integer end(const scene *c, integer t)
{
    return t + 1 < c->tiles ? (t + 1) * TILE : c->sites;
}

/* The displacements of this thread's sites, for all: those in `u` move while others look. */
static void share(const scene *c)
{
    const integer from = c->tile * TILE * DIM;
    if (c->tile < c->last_tile)
        EACH(end(c, c->last_tile - 1) * DIM - from) c->near[from + i] = c->u[from + i];
}

/* Forces of the contacts of a tile on its sites, in rows; what they do to others is stored. */
static void contacts(const scene *c, const real *u, integer t, real *restrict pull)
{
    const integer from = t * TILE, count = end(c, t) - from;
    EACH(count * ROW) pull[i] = 0;
    if (c->loaded)
        for (integer q = 0; q < count; q++)
            AXES(k) pull[q * ROW + k] = c->load[(from + q) * DIM + k];
    for (integer s = 0; s < c->runs; s++) {
        if (c->law[s] & 2 && t < c->tile) continue;
        switch (c->law[s]) {
#define CASES(K, OWN)                                                                       \
    case 4 * K + OWN: pairs_##K##_##OWN(c, u, s, t, pull); break;                           \
    case 4 * K + 2 + OWN: walls_##K##_##OWN(c, u, s, t, pull); break;
            RUNS(CASES)
        }
    }
}

/* Take what is in store for a tile's sites from its contacts and those of tiles before, for up to
   GROUP of them side by side.  SPARE numbers behind the last row of `pull` are read. */
static void take(const scene *c, integer t, real *restrict pull)
{
    const real *restrict store = c->store + c->piece * c->room * DIM * GROUP;
    const integer first = t * TILE, last = end(c, t);
    for (integer q = first / GROUP; q * GROUP < last; q++)
        for (int part = 0; part < GROUP && q * GROUP + part < last; part += WIDE) {
            const int *restrict site = c->taker + q * GROUP + part;
            real *mine = pull - first * ROW;
            pack sum[DIM];
            columns(mine, ROW, site, sum);
            for (integer e = c->taken_at[q]; e < c->taken_at[q + 1]; e++)
                AXES(k) sum[k] -= gathered(store + k * GROUP, c->taken + e * GROUP + part);
            put_rows(mine, site, sum);
        }
}

/* Forces on the walls, behind those of their contacts, which are added up in the order of the list
   and begin anew. */
static const real *on_walls(const scene *c)
{
    const real nothing[ROW] = {0};
    real *restrict press = c->press, *restrict force = press + c->pressing * ROW;
    for (integer q = 0; q < c->rows - c->sites; q++) {
        real whole[ROW];
        row sum = load_row(nothing);
        for (integer b = c->pressed[q]; b < c->pressed[q + 1]; b++) {
            sum = sum_of(sum, load_row(press + b * ROW));
            store_row(press + b * ROW, load_row(nothing));
        }
        store_row(whole, sum);
        AXES(k) force[q * DIM + k] = whole[k];
    }
    return force;
}

static void acceleration(const scene *c, const real *restrict u, real *restrict a)
{
    const integer moving = c->sites * DIM, all = c->rows * DIM;
    real pull[TILE * ROW + SPARE];
    for (integer t = 0; t < c->tiles; t++) {
        const integer from = t * TILE, count = end(c, t) - from;
        contacts(c, u, t, pull);
        take(c, t, pull);
        for (integer q = 0; q < count; q++)
            AXES(k) {
                const integer at = (from + q) * DIM + k;
                a[at] = c->w[at] * pull[q * ROW + k];
            }
    }
    const real *restrict force = on_walls(c);
    for (integer q = moving; q < all; q++) a[q] = c->w[q] * force[q - moving];
}

/* A kick by a and a drift by b of the sites of a tile; the farthest way. */
static real move_tile(const scene *c, integer t, real a, real b, const real *restrict pull)
{
    const integer from = t * TILE * DIM, count = end(c, t) - t * TILE;
    const real *restrict w = c->w + from;
    real *restrict u = c->u + from, *restrict v = c->v + from, largest = 0;
    pack farthest = wide(0);
    integer q = 0;
    for (; q + WIDE <= count; q += WIDE) {
        pack pulls[DIM];
        squeezed(pull + q * ROW, pulls);
        AXES(k) {
            const integer at = q * DIM + k * WIDE;
            const pack speed = load(v + at) + a * (load(w + at) * pulls[k]), move = b * speed;
            store(v + at, speed);
            store(u + at, load(u + at) + move);
            farthest = larger_of(magnitude(move), farthest);
        }
    }
    for (; q < count; q++)
        AXES(k) {
            const integer at = q * DIM + k;
            v[at] += a * (w[at] * pull[q * ROW + k]);
            const real move = b * v[at];
            u[at] += move;
            largest = larger(fabs(move), largest);
        }
    LANES_OF(l) largest = larger(LANE(farthest, l), largest);
    return largest;
}

static void stage(const scene *c, real a, real b)
{
    const integer moving = c->sites * DIM, all = c->rows * DIM;
    const real *u = c->pieces > 1 ? c->near : c->u;
    real pull[TILE * ROW + SPARE], largest = 0;
    if (c->pieces > 1) share(c);
    meet(c);
    for (integer t = c->before; t < c->tile; t++) contacts(c, u, t, pull);
    for (integer t = c->tile; t < c->last_tile; t++) {
        contacts(c, u, t, pull);
        take(c, t, pull);
        largest = larger(move_tile(c, t, a, b, pull), largest);
    }
    c->farthest[c->piece] = largest;
    meet(c);
    if (c->piece) return;
    for (integer k = 1; k < c->pieces; k++) largest = larger(largest, c->farthest[k]);
    *c->travel += largest;
    const real *restrict force = on_walls(c);
    for (integer q = moving; q < all; q++) {
        c->v[q] += a * c->w[q] * force[q - moving];
        c->u[q] += b * c->v[q];
    }
}
