/* A scene run backwards with the derivatives of what was computed.

   A stage of a run is v += a w F(u), then u += b v.  Given the state after it, and by it the
   derivatives of one or more objectives (ub, vb), the stage is undone and the derivatives are
   carried to before it:  vb += b ub;  ub += (dF/du)' a w vb;  what parameters and masses have to
   do with it is added up on the way.  Nothing is kept of the run but its last state. */

typedef struct {
    real *u, *v;                     /* (entries) */
    const real *w, *load;            /* (entries) inverse mass, 0 holds; constant forces */
    const real *shared;              /* (runs, PARAMETERS) */
    const real *own;                 /* for each run (own parameters of its law, its bonds) */
    const real *geometry;            /* (DIM + 2, bonds), of a network */
    const real *kicks, *drifts;      /* dt times the coefficients (stages + 1), (stages) */
    const real *grid;                /* (2) what rounds moves of u and of v to whole units */
    real *ub, *vb, *wb;              /* (objectives, entries) */
    real *pb;                        /* (objectives, wanted, apart) */
    real *gb;                        /* (objectives, bonds) by the elongations, of a network */
    real *r, *f, *k, *d;             /* scratch (apart), (apart + 2), (apart), (wanted, apart) */
    real *along, *pull, *turn;       /* scratch (DIM, bonds), (entries), (entries) */
    real *bent;                      /* scratch (apart), of a network */
    real *low, *high, *travel;       /* elongations met (bonds), and the way gone, as in net.h */
    const integer *from, *to;        /* (bonds) where their rows begin */
    const integer *first;            /* (runs + 1) first bond of each run */
    const integer *law;              /* (runs) twice the law, and 1 more with own parameters */
    const integer *wall;             /* (runs) whether its contacts are with walls */
    const integer *own_at;           /* (runs) where its own parameters begin */
    integer runs, bonds, entries, moving, objectives, wanted, stages, closing;
    integer room, apart; /* entries that move and fill packs; bonds, and a pack or two behind */
} scene;

/* What each objective adds to the derivatives after steps number `begin` to `end`: of the entries
   of u at the first `of_u` places, then of v. */
typedef struct {
    const real *rows;                /* (objectives, steps, places) */
    const integer *places;
    integer count, of_u, begin, end;
} seeds;

#if EXACT
static void tensions(const scene *c)
{
    for (integer s = 0; s < c->runs; s++) {
        const integer at = c->first[s], n = c->first[s + 1] - at;
        const real *shared = c->shared + s * PARAMETERS, *own = c->own + c->own_at[s];
        switch (c->law[s]) {
#define PULL_CASE(K, OWN) case 2 * K + OWN:                                                 \
            pull_##K##_##OWN(n, c->r + at, c->f + 1 + at, shared, own); break;
            RUNS(PULL_CASE)
        }
    }
}

/* Moves in whole units of the grid: (x + big) - big leaves no smaller part of x.  Added to what
   is whole they give what is whole, so that they can be taken away again to the last bit. */
__attribute__((noinline)) static void moves_of_u(
    const scene *c, real b, const real *restrict v, real *restrict move)
{
    const real big = c->grid[0];
    EACH(c->room) move[i] = (b * v[i] + big) - big;
}

__attribute__((noinline)) static void moves_of_v(
    const scene *c, real a, const real *restrict w, const real *restrict pull, real *restrict move)
{
    const real big = c->grid[1];
    EACH(c->room) move[i] = (a * w[i] * pull[i] + big) - big;
}
#endif

/* Tensions f[1 ..], stiffnesses and derivatives by the parameters wanted, at the elongations r. */
static void laws(const scene *c)
{
    for (integer s = 0; s < c->runs; s++) {
        const integer at = c->first[s], n = c->first[s + 1] - at;
        const real *shared = c->shared + s * PARAMETERS, *own = c->own + c->own_at[s];
        switch (c->law[s]) {
#define ROWS_CASE(K, OWN) case 2 * K + OWN:                                                 \
            rows_##K##_##OWN(n, c->apart, c->r + at, c->f + 1 + at, c->k + at, c->d + at,   \
                             shared, own);                                                  \
            break;
            RUNS(ROWS_CASE)
        }
    }
#if EXACT
    tensions(c);
#endif
#ifndef DIM /* packs went beyond the last bond, behind which nothing pulls */
    for (integer i = c->bonds; i < c->room; i++) c->f[1 + i] = c->k[i] = 0;
#endif
}
