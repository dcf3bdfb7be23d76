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
    const int *from, *to;               /* (contacts) rows; a wall is `from` */
    const integer *first;               /* (runs + 1) first contact of each run */
    const integer *kind, *law;          /* (runs) 0 pair, 1 wall; law */
    integer runs, contacts, sites, rows, stages, closing;
} scene;

#define AXES(k) for (int k = 0; k < DIM; k++)

#define RUN(KIND, K, DIFFERENCE)                                                            \
    __attribute__((flatten)) static void KIND##_run_##K(                                    \
        const scene *c, const real *restrict u, integer b, integer last)                    \
    {                                                                                       \
        const integer n = c->contacts;                                                      \
        real *restrict low = c->low, *restrict high = c->high, *restrict force = c->force;  \
        const real *restrict geometry = c->geometry, *restrict parameters = c->parameters;  \
        for (; b < last; b += LANES) {                                                      \
            real x[DIM][LANES], f[DIM][LANES];                                              \
            const int *from = c->from + b, *to = c->to + b;                                 \
            for (int i = 0; i < LANES; i++) AXES(k) x[k][i] = DIFFERENCE;                   \
            EACH(LANES) {                                                                 \
                real p[PARAMETERS + 1], d[DIM], w[DIM], r, along[DIM];                      \
                for (int k = 0; k < PARAMETERS; k++) p[k] = parameters[k * n + b + i];      \
                AXES(k) d[k] = geometry[k * n + b + i], w[k] = x[k][i];                     \
                KIND##_contact(d, w, geometry[DIM * n + b + i],                             \
                               geometry[(DIM + 1) * n + b + i], &r, along);                 \
                low[b + i] = r < low[b + i] ? r : low[b + i];                               \
                high[b + i] = r > high[b + i] ? r : high[b + i];                            \
                real tension = tension_##K(r, p);                                           \
                AXES(k) f[k][i] = tension * along[k];                                       \
            }                                                                               \
            for (int i = 0; i < LANES; i++)                                                 \
                AXES(k) {                                                                   \
                    force[from[i] * DIM + k] += f[k][i];                                    \
                    force[to[i] * DIM + k] -= f[k][i];                                      \
                }                                                                           \
        }                                                                                   \
    }
#define RUNS(K)                                                                             \
    RUN(pair, K, u[to[i] * DIM + k] - u[from[i] * DIM + k])                                 \
    RUN(wall, K, u[to[i] * DIM + k])
LAWS(RUNS)

/* Adds to `force`, which holds the loads. */
static void contacts(const scene *c, const real *u)
{
    for (integer s = 0; s < c->runs; s++)
        switch (2 * c->law[s] + c->kind[s]) {
#define CASES(K)                                                                            \
    case 2 * K: pair_run_##K(c, u, c->first[s], c->first[s + 1]); break;                    \
    case 2 * K + 1: wall_run_##K(c, u, c->first[s], c->first[s + 1]); break;
            LAWS(CASES)
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
        EACH(LANES) {
            v[q + i] += a * w[q + i] * force[q + i];
            real move = b * v[q + i];
            u[q + i] += move;
            force[q + i] = load[q + i];
            move = move < 0 ? -move : move;
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
