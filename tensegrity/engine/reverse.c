/* A scene run backwards with the derivatives of what was computed.

   A stage of a run is v += a w F(u), then u += b v.  Given the state after it, and by it the
   derivatives of one or more objectives (ub, vb), the stage is undone and the derivatives are
   carried to before it:  vb += b ub;  ub += (dF/du)' a w vb;  what parameters and masses have to
   do with it is added up on the way.  Nothing is kept of the run but its last state.

   On a line loops go on to `room`, a whole number of packs beyond the last site, where nothing
   weighs and nothing pulls.  Rows of a network are the sites and one that stands still for the
   walls. */

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
    real *low, *high, *travel;       /* elongations met (bonds), and the way gone, as in scene.h */
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
} cotangents;

/* Packs of bonds of one law: tensions, stiffnesses and derivatives by the parameters wanted. */
#define ARGUMENTS                                                                           \
    integer packs, integer apart, const real *restrict r, real *restrict f, real *restrict k, \
        real *restrict d, const real *restrict shared, const real *restrict own, integer all
typedef void packed(ARGUMENTS);
#define BOND_0(K) const real *p = shared;
#define BOND_1(K)                                                                           \
    real p[PARAMETERS + 1];                                                                 \
    take_##K(p, shared, own, all, i);

/* Of laws of which there are no packs: bond by bond. */
#define SCALAR_SLOPES(K, OWN, WANTED)                                                       \
    __attribute__((noinline, flatten)) static void slopes_##K##_##OWN(ARGUMENTS)            \
    {                                                                                       \
        EACH(packs *WIDE)                                                                   \
        {                                                                                   \
            BOND_##OWN(K)                                                                   \
            real y[2 + WANTED];                                                             \
            slopes_##K(r[i], p, y);                                                         \
            f[i] = y[0], k[i] = y[1];                                                       \
            for (int m = 0; m < WANTED; m++) d[m * apart + i] = y[2 + m];                   \
        }                                                                                   \
    }
SCALARS(SCALAR_SLOPES)

#define SLOPES(K, OWN) [2 * K + OWN] = slopes_##K##_##OWN,
static packed *const slopes[] = {RUNS(SLOPES)};

/* In batches that stay in the nearest cache; the last pack writes behind the n bonds. */
static void batches(packed *law, integer n, integer apart, const real *r, real *f, real *k, real *d,
                    const real *shared, const real *own)
{
    for (integer j = 0; j < n; j += ROOM * WIDE) {
        const integer left = n - j < ROOM * WIDE ? n - j : ROOM * WIDE;
        law((left + WIDE - 1) / WIDE, apart, r + j, f + j, k + j, d + j, shared, own + j, n);
    }
}

/* What laws give at the elongations r: tensions f[1 ..], and what goes with them. */
static void evaluated(const scene *c, packed *const *laws)
{
    for (integer s = 0; s < c->runs; s++) {
        const integer at = c->first[s];
        batches(laws[c->law[s]], c->first[s + 1] - at, c->apart, c->r + at, c->f + 1 + at, c->k + at,
                c->d + at, c->shared + s * PARAMETERS, c->own + c->own_at[s]);
    }
#ifndef DIM /* packs went beyond the last bond, behind which nothing pulls */
    for (integer i = c->bonds; i < c->room; i++) c->f[1 + i] = c->k[i] = 0;
#endif
}

#ifndef DIM
static void place(const scene *c)
{
    const real *restrict u = c->u;
    real *restrict r = c->r;
    EACH(c->room) r[i] = u[i + 1] - u[i];
}

/* The numbers one place before those of a pack, of which `before` are as many that come first.
   Read from memory where they were just stored, they would have to be waited for. */
PACKED pack shifted(pack before, pack here)
{
#if WIDE == 8
    return (pack)_mm512_alignr_epi64((__m512i)here, (__m512i)before, WIDE - 1);
#else
    pack y;
    LANES_OF(l) LANE(y, l) = l ? LANE(here, l - 1) : LANE(before, WIDE - 1);
    return y;
#endif
}

static void gather(const scene *c)
{
    pack before = wide(0);
    for (integer i = 0; i < c->room; i += WIDE) {
        const pack f = load(c->f + 1 + i);
        store(c->pull + i, f - shifted(before, f));
        before = f;
    }
}

/* From the derivatives by the velocities to those by masses, parameters and u. */
static void carry(const scene *c, real a, integer o)
{
    const integer apart = c->apart;
    const real *w = c->w, *vb = c->vb + o * c->entries, *k = c->k, *d = c->d;
    real *ub = c->ub + o * c->entries, *wb = c->wb + o * c->entries;
    real *pb = c->pb + o * c->wanted * apart;
    pack before = wide(0);
    for (integer i = 0; i < c->room; i += WIDE) {
        const pack push = a * load(vb + i);
        const pack bent = push * load(w + i) - a * load(vb + i + 1) * load(w + i + 1);
        const pack back = bent * load(k + i);
        store(wb + i, load(wb + i) + push * load(c->pull + i));
        for (integer m = i; m < i + c->wanted * apart; m += apart)
            store(pb + m, load(pb + m) + bent * load(d + m));
        store(ub + i, load(ub + i) + shifted(before, back) - back);
        before = back;
    }
}
#else
#define AXES(q) for (int q = 0; q < DIM; q++)

static void place(const scene *c)
{
    const integer n = c->bonds;
    const real *restrict u = c->u, *restrict geometry = c->geometry;
    real *restrict r = c->r, *restrict along = c->along;
    for (integer i = 0; i < n; i++) AXES(q) along[q * n + i] = u[c->to[i] + q] - u[c->from[i] + q];
    for (integer s = 0; s < c->runs; s++) {
        const integer at = c->first[s], many = c->first[s + 1] - at;
#define PLACED(contact)                                                                     \
    EACH(many) {                                                                            \
        real D[DIM], w[DIM], e[DIM];                                                        \
        const real *here = geometry + at + i;                                               \
        AXES(q) D[q] = here[q * n], w[q] = along[q * n + at + i];                           \
        contact(D, w, here[DIM * n], here[(DIM + 1) * n], &r[at + i], e);                   \
        AXES(q) along[q * n + at + i] = e[q];                                               \
    }
        if (c->wall[s]) PLACED(wall_contact) else PLACED(pair_contact)
    }
}

static void gather(const scene *c)
{
    const integer n = c->bonds;
    const real *restrict f = c->f + 1, *restrict along = c->along;
    real *restrict pull = c->pull;
    EACH(c->entries) pull[i] = c->load[i];
    for (integer i = 0; i < n; i++)
        AXES(q) {
            const real part = f[i] * along[q * n + i];
            pull[c->from[i] + q] += part;
            pull[c->to[i] + q] -= part;
        }
}

/* A force pulls along the bond, which turns: rb n + T/(L + r) (1 - n n') of the derivatives by it. */
static void carry(const scene *c, real a, integer o)
{
    const integer n = c->bonds, apart = c->apart;
    const real *vb = c->vb + o * c->entries;
    real *wb = c->wb + o * c->entries;
    EACH(c->entries) {
        c->turn[i] = a * c->w[i] * vb[i];
        wb[i] += a * vb[i] * c->pull[i];
    }
    const real *restrict turn = c->turn, *restrict k = c->k, *restrict d = c->d;
    const real *restrict f = c->f + 1, *restrict r = c->r, *restrict along = c->along;
    const real *restrict length = c->geometry + (DIM + 1) * n;
    real *restrict ub = c->ub + o * c->entries, *restrict pb = c->pb + o * c->wanted * apart;
    real *restrict bent = c->bent, *restrict gb = c->gb + o * n;
    for (integer s = 0; s < c->runs; s++)
        for (integer i = c->first[s]; i < c->first[s + 1]; i++) {
            real y[DIM], t = 0;
            AXES(q) y[q] = turn[c->from[i] + q] - turn[c->to[i] + q];
            AXES(q) t += y[q] * along[q * n + i];
            const real across = c->wall[s] || DIM == 1 ? 0 : f[i] / (length[i] + r[i]);
            bent[i] = t;
            AXES(q) y[q] = t * k[i] * along[q * n + i] + across * (y[q] - t * along[q * n + i]);
            AXES(q) ub[c->to[i] + q] += y[q];
            AXES(q) ub[c->from[i] + q] -= y[q];
        }
    EACH(n) gb[i] += bent[i] * k[i];
    for (integer m = 0; m < c->wanted; m++)
        EACH(n) pb[m * apart + i] += bent[i] * d[m * apart + i];
}
#endif

#if EXACT
#define SCALAR_PULL(K, OWN, WANTED)                                                         \
    __attribute__((noinline, flatten)) static void pull_##K##_##OWN(ARGUMENTS)              \
    {                                                                                       \
        EACH(packs *WIDE) { BOND_##OWN(K) f[i] = tension_##K(r[i], p); }                    \
    }
SCALARS(SCALAR_PULL)
#define PULLS(K, OWN) [2 * K + OWN] = pull_##K##_##OWN,
static packed *const pulls[] = {RUNS(PULLS)}; /* one text of the tension for both directions */

/* Moves in whole units of the grid: (x + big) - big leaves no smaller part of x.  Added to what
   is whole they give what is whole, so that they can be taken away again to the last bit. */
__attribute__((noinline)) static real *moves_of_u(const scene *c, real b)
{
    const real big = c->grid[0], *restrict v = c->v;
    real *restrict move = c->turn;
    EACH(c->room) move[i] = (b * v[i] + big) - big;
    return move;
}

__attribute__((noinline)) static real *moves_of_v(const scene *c, real a)
{
    const real big = c->grid[1], *restrict w = c->w, *restrict pull = c->pull;
    real *restrict move = c->turn;
    EACH(c->room) move[i] = (a * w[i] * pull[i] + big) - big;
    return move;
}

/* For `steps.c`. */
static void stage(const scene *c, real a, real b)
{
    if (a != 0) {
        place(c);
        real *low = c->low, *high = c->high, *r = c->r;
        EACH(c->bonds) {
            low[i] = r[i] < low[i] ? r[i] : low[i];
            high[i] = r[i] > high[i] ? r[i] : high[i];
        }
        evaluated(c, pulls);
        gather(c);
        const real *move = moves_of_v(c, a);
        EACH(c->room) c->v[i] += move[i];
    }
    if (b == 0) return;
    real largest = 0;
    const real *move = moves_of_u(c, b);
    for (integer i = 0; i < c->moving; i++) largest = larger(largest, fabs(move[i]));
    EACH(c->room) c->u[i] += move[i];
    *c->travel += largest;
}
#endif

static void reverse_stage(const scene *c, real a, real b)
{
#if EXACT
    const real *move = moves_of_u(c, b);
    EACH(c->room) c->u[i] -= move[i];
#else
    EACH(c->room) c->u[i] -= b * c->v[i];
#endif
    for (integer o = 0; o < c->objectives; o++) {
        real *ub = c->ub + o * c->entries, *vb = c->vb + o * c->entries;
        EACH(c->room) vb[i] += b * ub[i];
    }
    if (a == 0) return;
    place(c);
    evaluated(c, slopes);
#if EXACT
    evaluated(c, pulls);
    gather(c);
    move = moves_of_v(c, a);
    EACH(c->room) c->v[i] -= move[i];
#else
    gather(c);
    EACH(c->room) c->v[i] -= a * c->w[i] * c->pull[i];
#endif
    for (integer o = 0; o < c->objectives; o++) carry(c, a, o);
}

/* Add what the objectives have to do with the state after step number k. */
void add_cotangents(const scene *c, const cotangents *s, integer k)
{
    if (k < s->begin || k > s->end) return;
    for (integer o = 0; o < c->objectives; o++) {
        const real *row = s->rows + (o * (s->end - s->begin + 1) + k - s->begin) * s->count;
        for (integer j = 0; j < s->of_u; j++) c->ub[o * c->entries + s->places[j]] += row[j];
        for (integer j = s->of_u; j < s->count; j++)
            c->vb[o * c->entries + s->places[j]] += row[j];
    }
}

/* Undo `steps` steps, the last of them number `last`, as `advance` did them. */
void reverse(const scene *c, integer steps, integer opened, integer last, const cotangents *s)
{
    FLUSH
    for (integer k = steps - 1; k >= 0; k--) {
        for (integer i = c->stages - 1; i >= 0; i--)
            reverse_stage(c, KICK(c, i, k > 0 || opened), c->drifts[i]);
        if (s) add_cotangents(c, s, last - (steps - k));
    }
}

/* Of n elongations of a bond of one law, with its parameters p; rows `apart` from each other, which
   leave room for a pack behind the last. */
void evaluate(integer law, integer n, integer apart, const real *p, const real *r, real *f, real *k,
              real *d)
{
    batches(slopes[2 * law], n, apart, r, f, k, d, p, p);
}
