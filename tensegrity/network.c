/* One compiled loop for masses in the plane or in space, joined by contacts in any pattern.

   Included behind the generated laws (see chain.c) and the generated geometry: DIM coordinates,
   pair_contact and wall_contact of (reference D, difference w, initial gap g, length L), which
   give the elongation r and its gradient n in w.

   Rows of u, v and force: the sites, the walls, one more that takes what is left over.  A wall's
   row collects its impulse in v.  Contacts come in runs of one kind and one law, filled up to
   whole groups of LANES: every contact is computed by the same instructions wherever it stands
   in the list, so that equal neighbourhoods feel equal forces to the last bit, and the sums at a
   site are taken in the order of the list. */

#define LANES 8

typedef struct {
    real *u, *v, *force;                /* (rows, DIM) */
    const real *w;                      /* (rows, DIM) inverse mass; 0 holds a site */
    const real *load;                   /* (rows, DIM) constant forces */
    const real *geometry;               /* (DIM + 2, contacts) D, g, L */
    const real *parameters;             /* (PARAMETERS, contacts) */
    const real *kicks, *drifts;         /* dt times the coefficients (stages + 1), (stages) */
    real *low, *high;                   /* (contacts) smallest and largest elongation met */
    real *travel;                       /* bound on how far any coordinate of a site moved */
    const integer *from, *to;           /* (contacts) where their rows begin; a wall is `from` */
    const integer *first;               /* (runs + 1) first contact of each run */
    const integer *kind, *law;          /* (runs) 0 pair, 1 wall, 2 more with shared parameters */
    integer runs, contacts, sites, rows, stages, closing;
} scene;

/* Unrolled first, the loop would be taken apart into scalars and branches. */
#define WHOLE_LANES _Pragma("GCC unroll 1") EACH(LANES)
#define AXES(k) for (int k = 0; k < DIM; k++)

/* Tensions of a group of contacts at the elongations r: parameters shared, or each its own.  A
   long law is kept in one function, so that it is compiled once only. */
#define TENSIONS(K, PREFIX, NAME, LANE)                                                     \
    PREFIX __attribute__((flatten)) void NAME##_##K(                                        \
        const real *restrict parameters, integer n, const real *restrict r, real *restrict t) \
    {                                                                                       \
        WHOLE_LANES {                                                                       \
            real p[PARAMETERS + 1];                                                         \
            for (int k = 0; k < PARAMETERS; k++) p[k] = parameters[k * n + LANE];           \
            t[i] = tail_##K(r[i], head_##K(r[i], p), p);                                    \
        }                                                                                   \
    }
/* The force is rounded before it is added to one site and subtracted from the other: contracted
   with the sums the two would differ, and mirrored sites with them. */
#define ROUNDED(array) __asm__("" : "+m"(array));

#define RUN(KIND, K, WHICH, DIFFERENCE)                                                     \
    __attribute__((flatten)) static void KIND##_##WHICH##_##K(                              \
        const scene *c, const real *restrict u, integer b, integer last)                    \
    {                                                                                       \
        const integer n = c->contacts;                                                      \
        real *restrict low = c->low, *restrict high = c->high, *restrict force = c->force;  \
        const real *restrict geometry = c->geometry;                                        \
        for (; b < last; b += LANES) {                                                      \
            real x[DIM][LANES], along[DIM][LANES], r[LANES], t[LANES];                      \
            const integer *restrict from = c->from + b, *restrict to = c->to + b;           \
            for (int i = 0; i < LANES; i++) AXES(k) x[k][i] = DIFFERENCE;                   \
            EACH(LANES) {                                                                   \
                real d[DIM], w[DIM], e[DIM];                                                \
                AXES(k) d[k] = geometry[k * n + b + i], w[k] = x[k][i];                     \
                KIND##_contact(d, w, geometry[DIM * n + b + i],                             \
                               geometry[(DIM + 1) * n + b + i], &r[i], e);                  \
                AXES(k) along[k][i] = e[k];                                                 \
                low[b + i] = r[i] < low[b + i] ? r[i] : low[b + i];                         \
                high[b + i] = r[i] > high[b + i] ? r[i] : high[b + i];                      \
            }                                                                               \
            WHICH##_##K(c->parameters + b, n, r, t);                                        \
            AXES(k) EACH(LANES) along[k][i] *= t[i];                                        \
            ROUNDED(along)                                                                  \
            for (int i = 0; i < LANES; i++)                                                 \
                AXES(k) {                                                                   \
                    force[from[i] + k] += along[k][i];                                      \
                    force[to[i] + k] -= along[k][i];                                        \
                }                                                                           \
        }                                                                                   \
    }
#define RUNS(K, WHICH)                                                                      \
    RUN(pair, K, WHICH, u[to[i] + k] - u[from[i] + k])                                      \
    RUN(wall, K, WHICH, u[to[i] + k])
#define SHORT(K)                                                                            \
    TENSIONS(K, static inline __attribute__((always_inline)), shared, 0)                    \
    TENSIONS(K, static inline __attribute__((always_inline)), own, i)                       \
    RUNS(K, shared) RUNS(K, own)
#define LONG(K)                                                                             \
    TENSIONS(K, static __attribute__((noinline)), own, i)                                   \
    RUNS(K, own)
#define LAW(K, LENGTH) LENGTH(K)
LENGTHS(LAW)

/* Adds to `force`, which holds the loads. */
static void contacts(const scene *c, const real *u)
{
    for (integer s = 0; s < c->runs; s++) {
        const integer b = c->first[s], last = c->first[s + 1];
        switch (4 * c->law[s] + c->kind[s]) {
#define CASE(K, KIND, NUMBER, WHICH) case 4 * K + NUMBER: KIND##_##WHICH##_##K(c, u, b, last); break;
#define CASES(K, FIRST, SECOND)                                                             \
    CASE(K, pair, 0, FIRST) CASE(K, wall, 1, FIRST)                                         \
    CASE(K, pair, 2, SECOND) CASE(K, wall, 3, SECOND)
#define SHORT_CASES(K) CASES(K, own, shared)
#define LONG_CASES(K) CASES(K, own, own)
#define LAW_CASES(K, LENGTH) LENGTH##_CASES(K)
            LENGTHS(LAW_CASES)
        }
    }
}

static void acceleration(const scene *c, const real *restrict u, real *restrict a)
{
    real *restrict force = c->force;
    contacts(c, u);
    EACH(c->rows * DIM) {
        a[i] = c->w[i] * force[i];
        force[i] = c->load[i];
    }
}

static void stage(const scene *c, real a, real b)
{
    real *restrict u = c->u, *restrict v = c->v, *restrict force = c->force;
    const real *restrict w = c->w, *restrict load = c->load;
    const integer moving = c->sites * DIM, all = c->rows * DIM;
    real farthest[LANES] = {0}, largest = 0;
    contacts(c, u);
    integer q = 0;
    for (; q + LANES <= moving; q += LANES)
        WHOLE_LANES {
            v[q + i] += a * w[q + i] * force[q + i];
            real move = b * v[q + i];
            u[q + i] += move;
            force[q + i] = load[q + i];
            move = fabs(move);
            farthest[i] = move > farthest[i] ? move : farthest[i];
        }
    for (; q < all; q++) {
        v[q] += a * w[q] * force[q];
        real move = b * v[q];
        u[q] += move;
        force[q] = load[q];
        if (q < moving) largest = larger(largest, fabs(move));
    }
    for (int i = 0; i < LANES; i++) largest = larger(largest, farthest[i]);
    *c->travel += largest;
}

/* `steps` steps; the closing kick of a step and the first of the next are one. */
void advance(const scene *c, integer steps)
{
    real closing = c->closing ? c->kicks[c->stages] : 0;
    for (integer k = 0; k < steps; k++)
        for (integer i = 0; i < c->stages; i++)
            stage(c, c->kicks[i] + (k > 0 && i == 0 ? closing : 0), c->drifts[i]);
    if (steps > 0 && c->closing) stage(c, closing, 0);
}
