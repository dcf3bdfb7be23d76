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

/* The displacements of this thread's sites, for all: those in `u` move while others look. */
static void share(const scene *c)
{
    const integer last = c->last_tile < c->tiles ? c->last_tile * TILE : c->sites;
    const integer from = c->tile * TILE * DIM, count = last * DIM - from;
    EACH(count) c->near[from + i] = c->u[from + i];
}

/* Entries of a tile. */
static integer entries(const scene *c, integer t)
{
    const integer left = c->sites - t * TILE;
    return DIM * (left < TILE ? left : TILE);
}

/* Forces of the contacts of a tile on its sites; what they do to others is stored. */
static void contacts(const scene *c, const real *u, integer t, real *restrict pull)
{
    const real *restrict load = c->load + t * TILE * DIM;
    EACH(entries(c, t)) pull[i] = c->loaded ? load[i] : 0;
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

/* Accelerations of a tile's sites, up to GROUP of them side by side: with what is in store for them
   from tiles before.  SPARE numbers behind the last row of `pull` are read. */
static void accelerate(const scene *c, integer t, real *restrict pull)
{
    const real *restrict store = c->store + c->piece * c->room * DIM * GROUP;
    const integer first = t * TILE, last = first + entries(c, t) / DIM;
    for (integer q = first / GROUP; q * GROUP < last; q++)
        for (int part = 0; part < GROUP && q * GROUP + part < last; part += WIDE) {
            const int *restrict site = c->taker + q * GROUP + part;
            const pack mobility = load(c->mobility + q * GROUP + part);
            real *mine = pull - first * DIM;
            pack sum[DIM];
            columns(mine, site, sum);
            for (integer e = c->taken_at[q]; e < c->taken_at[q + 1]; e++)
                AXES(k) sum[k] -= gathered(store + k * GROUP, c->taken + e * GROUP + part);
            AXES(k) sum[k] *= mobility;
            LANES_OF(l) AXES(k) mine[site[l] + k] = LANE(sum[k], l);
        }
}

/* Forces on the walls, each the sum over its contacts in the order of the list. */
static const real *on_walls(const scene *c)
{
    real *restrict force = c->press + c->contacts * DIM;
    const integer moving = c->sites * DIM;
    EACH(c->rows * DIM - moving) force[i] = 0;
    for (integer s = 0; s < c->runs; s++)
        if (c->law[s] & 2)
            for (integer b = c->first[s]; b < c->first[s + 1]; b++)
                AXES(k) force[c->from[b] - moving + k] += c->press[b * DIM + k];
    return force;
}

static void acceleration(const scene *c, const real *restrict u, real *restrict a)
{
    const integer moving = c->sites * DIM, all = c->rows * DIM;
    for (integer t = 0; t < c->tiles; t++) {
        contacts(c, u, t, a + t * TILE * DIM);
        accelerate(c, t, a + t * TILE * DIM);
    }
    const real *restrict force = on_walls(c);
    for (integer q = moving; q < all; q++) a[q] = c->w[q] * force[q - moving];
}

/* A kick by a and a drift by b of `count` entries with accelerations `pull`; the farthest way. */
static real move_tile(
    integer count, real a, real b, const real *restrict pull, real *restrict u, real *restrict v)
{
    real farthest[GROUP] = {0}, largest = 0;
    integer q = 0;
    for (; q + GROUP <= count; q += GROUP) {
        _Pragma("GCC unroll 1") EACH(GROUP) {
            v[q + i] += a * pull[q + i];
            real move = b * v[q + i];
            u[q + i] += move;
            move = fabs(move);
            farthest[i] = move > farthest[i] ? move : farthest[i];
        }
    }
    for (; q < count; q++) {
        v[q] += a * pull[q];
        const real move = b * v[q];
        u[q] += move;
        largest = larger(largest, fabs(move));
    }
    for (int i = 0; i < GROUP; i++) largest = larger(largest, farthest[i]);
    return largest;
}

static void stage(const scene *c, real a, real b)
{
    const integer moving = c->sites * DIM, all = c->rows * DIM;
    const real *u = c->pieces > 1 ? c->near : c->u;
    real pull[TILE * DIM + SPARE], largest = 0;
    if (c->pieces > 1) share(c);
    meet(c);
    for (integer t = c->before; t < c->tile; t++) contacts(c, u, t, pull);
    for (integer t = c->tile; t < c->last_tile; t++) {
        const integer from = t * TILE * DIM;
        contacts(c, u, t, pull);
        accelerate(c, t, pull);
        const real way = move_tile(entries(c, t), a, b, pull, c->u + from, c->v + from);
        largest = larger(largest, way);
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
