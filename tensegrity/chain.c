/* One compiled loop for every chain and every splitting method.

   Included behind the generated laws.  For each law K the generated text provides head_K of
   (elongation, parameters), tail_K of (elongation, head, parameters) and those of energy_K,
   tension_K, stiffness_K, slope_K that are to be compiled; further the macros LAWS(X), which lists
   X(0) X(1) ..., LENGTHS(X), the same with SHORT or LONG, EVALUATIONS(X), which lists
   X(K, order, name), and PARAMETERS, the largest number of parameters.

   A stage is a kick v += a w (tension right - tension left) followed by a drift u += b v, done
   in one pass over the chain in blocks that stay in the nearest cache.  The innermost square root
   of a law (head) is computed in the loop that updates the block before, apart from the rest
   (tail): what limits a processor here is the longest chain of slow operations that fits its
   window, not their number alone.

   Several chains of the same springs run at once as lanes of the last axis: all entries of site j,
   one per lane, stand together, and the neighbour of an entry is LANES further. */

#define BLOCK 64
#ifndef LANES
#define LANES 1
#endif
#define CARRY(n) for (int l = 0; l < LANES; l++) f[l] = f[(n) + l];

typedef struct {
    real *u, *v;                     /* displacement, velocity (sites, LANES) */
    const real *w;                   /* inverse mass; 0 holds a site (sites, LANES) */
    const real *parameters;          /* (segments, PARAMETERS) */
    const real *kicks, *drifts;      /* dt times the coefficients (stages + 1), (stages) */
    real *range;                     /* (segments, 2) smallest and largest elongation met */
    const integer *first;            /* (segments + 1) first bond of each segment of one law */
    const integer *law;              /* (segments) */
    integer segments, stages, closing; /* closing: the method ends with a kick */
} chain;
typedef chain scene;

#define HEAD(K, j)                                                                          \
    r[i] = u[(j) + i + LANES] - u[(j) + i];                                                 \
    low[i] = r[i] < low[i] ? r[i] : low[i];                                                 \
    high[i] = r[i] > high[i] ? r[i] : high[i];                                              \
    h[i] = head_##K(r[i], p);

#define UPDATE(j)                                                                           \
    v[(j) + i] += a * w[(j) + i] * (f[i + LANES] - f[i]);                                   \
    u[(j) + i] += b * v[(j) + i];

/* A long law is kept in a function of its own, so that it is compiled once only. */
#define ROW(K)                                                                              \
    __attribute__((noinline, flatten)) static void row_##K(                                 \
        integer n, const real *restrict r, const real *restrict h, real *restrict f,        \
        const real *p)                                                                      \
    {                                                                                       \
        EACH(n) f[i] = tail_##K(r[i], h[i], p);                                             \
    }
LAWS(ROW)
#define SHORT(K, n) EACH(n) f[i + LANES] = tail_##K(r[i], h[i], p);
#define LONG(K, n) row_##K(n, r, h, f + LANES, p);

#define SEGMENT(K, TAILS)                                                                   \
    __attribute__((flatten)) static void stage_##K(                                         \
        const chain *c, integer s, real a, real b, real *left)                              \
    {                                                                                       \
        real p[PARAMETERS + 1], r[BLOCK], h[BLOCK], f[BLOCK + LANES];                       \
        real low[BLOCK], high[BLOCK];                                                       \
        real *restrict u = c->u, *restrict v = c->v;                                        \
        const real *restrict w = c->w;                                                      \
        real *range = c->range + 2 * s;                                                     \
        integer j = LANES * c->first[s], last = LANES * c->first[s + 1];                    \
        for (int i = 0; i < PARAMETERS; i++) p[i] = c->parameters[s * PARAMETERS + i];      \
        for (int i = 0; i < BLOCK; i++) low[i] = range[0], high[i] = range[1];              \
        for (int l = 0; l < LANES; l++) f[l] = left[l];                                     \
        integer odd = (last - j) % BLOCK;                                                   \
        if (odd) {                                                                          \
            EACH(odd) { HEAD(K, j) }                                                        \
            TAILS(K, odd)                                                                   \
            EACH(odd) { UPDATE(j) }                                                         \
            CARRY(odd)                                                                      \
            j += odd;                                                                       \
        }                                                                                   \
        if (j < last) {                                                                     \
            EACH(BLOCK) { HEAD(K, j) }                                                      \
            for (; j + BLOCK < last; j += BLOCK) {                                          \
                TAILS(K, BLOCK)                                                             \
                EACH(BLOCK) { HEAD(K, j + BLOCK) UPDATE(j) }                                \
                CARRY(BLOCK)                                                                \
            }                                                                               \
            TAILS(K, BLOCK)                                                                 \
            EACH(BLOCK) { UPDATE(j) }                                                       \
            CARRY(BLOCK)                                                                    \
        }                                                                                   \
        for (int l = 0; l < LANES; l++) left[l] = f[l];                                     \
        for (int i = 0; i < BLOCK; i++) {                                                   \
            range[0] = low[i] < range[0] ? low[i] : range[0];                               \
            range[1] = high[i] > range[1] ? high[i] : range[1];                             \
        }                                                                                   \
    }
LENGTHS(SEGMENT)

static void stage(const chain *c, real a, real b)
{
    real left[LANES] = {0};
    for (integer s = 0; s < c->segments; s++)
        switch (c->law[s]) {
#define CASE(K) case K: stage_##K(c, s, a, b, left); break;
            LAWS(CASE)
        }
    integer end = LANES * c->first[c->segments];
    for (int l = 0; l < LANES; l++) {
        c->v[end + l] -= a * c->w[end + l] * left[l];
        c->u[end + l] += b * c->v[end + l];
    }
}

/* `steps` steps; the closing kick of a step and the first of the next are one.  A part of a run
   may be `opened` by the closing kick of the part before, and leave its own to the next. */
void advance_part(const chain *c, integer steps, integer opened, integer close)
{
    real closing = c->closing ? c->kicks[c->stages] : 0;
    for (integer k = 0; k < steps; k++)
        for (integer i = 0; i < c->stages; i++)
            stage(c, c->kicks[i] + ((k > 0 || opened) && i == 0 ? closing : 0), c->drifts[i]);
    if (steps > 0 && c->closing && close) stage(c, closing, 0);
}

void advance(const chain *c, integer steps) { advance_part(c, steps, 0, 1); }

#define PULL(K)                                                                             \
    __attribute__((flatten)) static void pull_##K(                                          \
        const chain *c, integer s, const real *restrict u, real *restrict a, real *left)    \
    {                                                                                       \
        real p[PARAMETERS + 1], r[BLOCK], f[BLOCK + LANES];                                 \
        real *range = c->range + 2 * s;                                                     \
        for (int i = 0; i < PARAMETERS; i++) p[i] = c->parameters[s * PARAMETERS + i];      \
        for (integer j = LANES * c->first[s], n; j < LANES * c->first[s + 1]; j += n) {     \
            n = LANES * c->first[s + 1] - j;                                                \
            n = n < BLOCK ? n : BLOCK;                                                      \
            for (int l = 0; l < LANES; l++) f[l] = left[l];                                 \
            EACH(n) r[i] = u[j + i + LANES] - u[j + i];                                     \
            EACH(n) f[i + LANES] = tail_##K(r[i], head_##K(r[i], p), p);                    \
            EACH(n) a[j + i] = c->w[j + i] * (f[i + LANES] - f[i]);                         \
            for (integer i = 0; i < n; i++) {                                               \
                range[0] = r[i] < range[0] ? r[i] : range[0];                               \
                range[1] = r[i] > range[1] ? r[i] : range[1];                               \
            }                                                                               \
            for (int l = 0; l < LANES; l++) left[l] = f[n + l];                             \
        }                                                                                   \
    }
LAWS(PULL)

static void acceleration(const chain *c, const real *u, real *a)
{
    real left[LANES] = {0};
    for (integer s = 0; s < c->segments; s++)
        switch (c->law[s]) {
#define PULL_CASE(K) case K: pull_##K(c, s, u, a, left); break;
            LAWS(PULL_CASE)
        }
    integer end = LANES * c->first[c->segments];
    for (int l = 0; l < LANES; l++) a[end + l] = -c->w[end + l] * left[l];
}

#define EVALUATE(K, ORDER, NAME)                                                            \
    if (law == K && order == ORDER)                                                         \
        for (integer i = 0; i < n; i++) out[i] = NAME##_##K(r[i], p);

/* The order-th derivative of one law's energy at n elongations. */
void evaluate(integer law, integer order, integer n, const real *parameters, const real *restrict r,
              real *restrict out)
{
    real p[PARAMETERS + 1];
    for (int i = 0; i < PARAMETERS; i++) p[i] = parameters[i];
    EVALUATIONS(EVALUATE)
}
