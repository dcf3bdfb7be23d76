/* The reverse loop: inverts the stages of a run and propagates derivatives of objectives.

   A stage of a run is v += a w F(u), then u += b v.  From the state after it and the derivatives
   of one or more objectives with respect to it (ub, vb), the stage is inverted and the
   derivatives before it are computed: vb += b ub; ub += (dF/du)' a w vb; those with respect to
   parameters and masses are accumulated.  No state of the run is stored except the last one.

   In a chain, loops extend to `room`, a whole number of SIMD vectors beyond the last site, with
   zero forces and inverse masses there.  The rows of a network are the sites and a fixed one for
   all walls. */

typedef struct {
    real *u, *v;                     /* (entries) */
    const real *w, *load;            /* (entries) inverse mass, 0 if fixed; constant forces */
    const real *shared;              /* (runs, PARAMETERS) */
    const real *own;                 /* for each run (own parameters of its law, its bonds) */
    const real *geometry;            /* (DIM + 2, bonds), of a network */
    const real *values;              /* (bonds, PARAMETERS) of a law of both ends */
    const real *kicks, *drifts;      /* dt times the coefficients (stages + 1), (stages) */
    real *ub, *vb, *wb;              /* (objectives, entries) */
    real *pb;                        /* (objectives, wanted, stride) */
    real *gb;                        /* (objectives, bonds) of elongations, in a network */
    real *r, *f, *k, *d;             /* scratch (stride), (stride + 2), (stride), (wanted, stride) */
    real *along, *pull, *turn;       /* scratch (DIM or 2 DIM, bonds), (entries), (entries) */
    real *bent;                      /* scratch (stride), of a network */
    const integer *from, *to;        /* (bonds) where their rows begin */
    const integer *first;            /* (runs + 1) first bond of each run */
    const integer *law;              /* (runs) twice the law, and 1 more with own parameters */
    const integer *wall;             /* (runs) whether its contacts are with walls */
    const integer *own_at;           /* (runs) where its own parameters begin */
    const integer *coupled;          /* (couplings, 2) as in scene.h, of bonds with mass */
    const real *coupling;            /* (couplings, DIM) */
    const integer *heavy;            /* (heavies, 2) where the rows of bonds with mass begin */
    real *hb;                        /* (objectives, heavies) of their entries of the mass matrix,
                                        with minus sign, like `wb` then of its diagonal */
    integer couplings, heavies;
    integer runs, bonds, entries, objectives, wanted, stages, closing;
    integer room, stride; /* padded number of entries; stride of arrays over bonds */
    integer together;    /* whether scratch k, d and pull have rows for all stages */
} scene;

/* Derivatives of each objective with respect to the states after steps number `begin` to `end`: to
   the entries of u at the first `u_count` places, then of v. */
typedef struct {
    const real *rows;                /* (objectives, steps, places) */
    const integer *places;
    integer count, u_count, begin, end;
} cotangents;

/* Vectors of bonds of one law: tensions, stiffnesses and derivatives in the requested
   parameters. */
#define ARGUMENTS                                                                           \
    integer packs, integer stride, const real *restrict r, real *restrict f, real *restrict k, \
        real *restrict d, const real *restrict shared, const real *restrict own, integer all
typedef void packed(ARGUMENTS);
#define BOND_0(K) const real *p = shared;
#define BOND_1(K)                                                                           \
    real p[PARAMETERS + 1];                                                                 \
    take_##K(p, shared, own, all, i);

/* For laws without SIMD code: bond by bond. */
#define SCALAR_SLOPES(K, OWN, WANTED)                                                       \
    __attribute__((noinline, flatten)) static void slopes_##K##_##OWN(ARGUMENTS)            \
    {                                                                                       \
        EACH(packs *WIDE)                                                                   \
        {                                                                                   \
            BOND_##OWN(K)                                                                   \
            real y[2 + WANTED];                                                             \
            slopes_##K(r[i], p, y);                                                         \
            f[i] = y[0], k[i] = y[1];                                                       \
            for (int m = 0; m < WANTED; m++) d[m * stride + i] = y[2 + m];                   \
        }                                                                                   \
    }
SCALARS(SCALAR_SLOPES)

#define SLOPES(K, OWN) [2 * K + OWN] = slopes_##K##_##OWN,
static packed *const slopes[] = {RUNS(SLOPES)};

/* In blocks that stay in the nearest cache; the last vector writes beyond the n bonds. */
static void batches(packed *law, integer n, integer stride, const real *r, real *f, real *k, real *d,
                    const real *shared, const real *own)
{
    for (integer j = 0; j < n; j += ROOM * WIDE) {
        const integer left = n - j < ROOM * WIDE ? n - j : ROOM * WIDE;
        law((left + WIDE - 1) / WIDE, stride, r + j, f + j, k + j, d + j, shared, own + j, n);
    }
}

/* Evaluate laws at the elongations r: tensions f[1 ..], stiffnesses and derivatives. */
static void evaluated(const scene *c, packed *const *laws)
{
    for (integer s = 0; s < c->runs; s++) {
        const integer at = c->first[s];
        batches(laws[c->law[s]], c->first[s + 1] - at, c->stride, c->r + at, c->f + 1 + at, c->k + at,
                c->d + at, c->shared + s * PARAMETERS, c->own + c->own_at[s]);
    }
#ifndef DIM /* no force beyond the last bond */
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

/* The numbers one place before those of a vector, where `before` is the vector before it.  Loads
   from memory would have to wait for the stores just made. */
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

/* The numbers one place after those of a vector, where `after` is the vector after it. */
PACKED pack shifted_back(pack here, pack after)
{
#if WIDE == 8
    return (pack)_mm512_alignr_epi64((__m512i)after, (__m512i)here, 1);
#else
    pack y;
    LANES_OF(l) LANE(y, l) = l < WIDE - 1 ? LANE(here, l + 1) : LANE(after, 0);
    return y;
#endif
}

/* The drift b; then from derivatives with respect to velocities to those with respect to masses,
   parameters and u.  Each vector waits for those of the stage before: several objectives at once. */
#define UNROLLED(l, n) _Pragma("GCC unroll 4") for (int l = 0; l < n; l++)
#define ROWS 4 /* objectives at once */

PACKED void carry_rows(const scene *c, real a, real b, integer o, const int rows)
{
    const integer room = c->room, entries = c->entries, stride = c->stride, all = c->wanted * stride;
    const real *w = c->w, *k = c->k, *d = c->d, *pull = c->pull;
    real *ub = c->ub + o * entries, *vb = c->vb + o * entries, *wb = c->wb + o * entries;
    real *pb = c->pb + o * all;
    pack before[ROWS], u[ROWS], v[ROWS], moved[ROWS];
    UNROLLED(l, rows) {
        before[l] = wide(0), u[l] = load(ub + l * entries);
        v[l] = load(vb + l * entries) + b * u[l], moved[l] = a * v[l] * load(w);
    }
    for (integer i = 0; i < room; i += WIDE) {
        const pack stiffness = load(k + i), force = load(pull + i), w_next = load(w + i + WIDE);
        UNROLLED(l, rows) {
            const integer at = l * entries + i, next = at + WIDE;
            const pack next_u = load(ub + next), next_v = load(vb + next) + b * next_u;
            const pack next_moved = a * next_v * w_next;
            const pack bent = moved[l] - shifted_back(moved[l], next_moved);
            const pack back = bent * stiffness;
            store(vb + at, v[l]);
            store(wb + at, load(wb + at) + a * v[l] * force);
            for (integer m = i; m < i + all; m += stride)
                store(pb + l * all + m, load(pb + l * all + m) + bent * load(d + m));
            store(ub + at, u[l] + shifted(before[l], back) - back);
            before[l] = back, u[l] = next_u, v[l] = next_v, moved[l] = next_moved;
        }
    }
}

static void carry(const scene *c, real a, real b, integer o, integer rows)
{
    if (rows == ROWS)
        carry_rows(c, a, b, o, ROWS);
    else
        for (integer l = 0; l < rows; l++) carry_rows(c, a, b, o + l, 1);
}
#else
#define AXES(q) for (int q = 0; q < DIM; q++)

static void place(const scene *c)
{
    const integer n = c->bonds;
    const real *restrict u = c->u, *restrict geometry = c->geometry;
    real *restrict r = c->r, *restrict along = c->along;
#ifdef ENDS
    for (integer i = 0; i < n; i++) {
        real slope[2 * DIM];
        pair_of_ends(u + c->from[i], u + c->to[i], c->values + i * PARAMETERS, r + i, slope);
        for (int q = 0; q < 2 * DIM; q++) along[q * n + i] = slope[q];
    }
    return;
#endif
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
#ifdef ENDS
            pull[c->from[i] + q] -= along[q * n + i];
            pull[c->to[i] + q] -= along[(DIM + q) * n + i];
#else
            const real part = f[i] * along[q * n + i];
            pull[c->from[i] + q] += part;
            pull[c->to[i] + q] -= part;
#endif
        }
}

/* The same; the force of a bond acts along it, and the bond rotates: k n n' + T/(L + r) (1 - n n').
 */
#define ROWS 1
static void carry(const scene *c, real a, real b, integer o, integer rows)
{
    const integer n = c->bonds, stride = c->stride;
    real *vb = c->vb + o * c->entries, *wb = c->wb + o * c->entries;
    EACH(c->entries) {
        vb[i] += b * c->ub[o * c->entries + i];
        c->turn[i] = a * c->w[i] * vb[i];
        wb[i] += a * vb[i] * c->pull[i];
    }
    if (c->heavies) { /* M^-1 vb, and its products with accelerations */
        EACH(c->entries) {
            wb[i] -= a * vb[i] * c->pull[i];
            c->turn[i] = a * vb[i];
        }
        COUPLE(c, c->turn, DIM)
        EACH(c->entries) c->turn[i] *= c->w[i];
        EACH(c->entries) wb[i] += c->turn[i] * c->w[i] * c->pull[i];
        real *hb = c->hb + o * c->heavies;
        for (integer h = 0; h < c->heavies; h++) {
            const integer i = c->heavy[2 * h], j = c->heavy[2 * h + 1];
            AXES(q)
                hb[h] += c->turn[i + q] * c->w[j + q] * c->pull[j + q] +
                         c->turn[j + q] * c->w[i + q] * c->pull[i + q];
        }
    }
    const real *restrict turn = c->turn, *restrict k = c->k, *restrict d = c->d;
    const real *restrict f = c->f + 1, *restrict r = c->r, *restrict along = c->along;
    const real *restrict length = c->geometry + (DIM + 1) * n;
    real *restrict ub = c->ub + o * c->entries, *restrict pb = c->pb + o * c->wanted * stride;
    real *restrict bent = c->bent, *restrict gb = c->gb + o * n;
#ifdef ENDS
    for (integer i = 0; i < n; i++) {
        const integer from = c->from[i], to = c->to[i];
        const real *at = c->u + from, *end = c->u + to;
        real y[2 * DIM], bent[2 * DIM + PARAMETERS];
        AXES(q) y[q] = turn[from + q], y[DIM + q] = turn[to + q];
        turned_of_ends(at, end, c->values + i * PARAMETERS, y, bent);
        AXES(q) ub[from + q] -= bent[q], ub[to + q] -= bent[DIM + q];
#define WANTED_SLOPE(m, of) pb[m * stride + i] -= bent[2 * DIM + of];
        WANTED(WANTED_SLOPE)
    }
    return;
#endif
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
        EACH(n) pb[m * stride + i] += bent[i] * d[m * stride + i];
}
#endif

/* The state before a stage; tensions and stiffnesses of its kick go to the arrays of c. */
static void invert(const scene *c, real a, real b)
{
    EACH(c->room) c->u[i] -= b * c->v[i];
    if (a == 0) return;
    place(c);
    evaluated(c, slopes);
    gather(c);
#ifdef DIM
    COUPLE(c, c->pull, DIM)
#endif
    EACH(c->room) c->v[i] -= a * c->w[i] * c->pull[i];
}

/* Arrays for the kick of stage i; the objectives of a chain take all stages of a step one after the
   other, some at a time, while their derivatives are in the nearest cache. */
static scene of_stage(const scene *c, integer i)
{
    scene one = *c;
    one.k += i * c->stride, one.d += i * c->wanted * c->stride, one.pull += i * c->entries;
    return one;
}

static void reverse_stages(const scene *c, integer first, integer last, int before)
{
    scene stages[c->stages];
    for (integer i = last; i >= first; i--) {
        stages[i] = of_stage(c, last > first ? i : 0);
        invert(&stages[i], KICK(c, i, before), c->drifts[i]);
    }
    for (integer o = 0; o < c->objectives; o += ROWS) {
        const integer rows = c->objectives - o < ROWS ? c->objectives - o : ROWS;
        const real *restrict ub = c->ub + o * c->entries;
        real *restrict vb = c->vb + o * c->entries;
        for (integer i = last; i >= first; i--) {
            const real a = KICK(c, i, before), b = c->drifts[i];
            if (a != 0)
                carry(&stages[i], a, b, o, rows);
            else
                EACH(rows *c->entries) vb[i] += b * ub[i];
        }
    }
}

/* Add the derivatives of the objectives with respect to the state after step number k. */
void add_cotangents(const scene *c, const cotangents *s, integer k)
{
    if (k < s->begin || k > s->end) return;
    for (integer o = 0; o < c->objectives; o++) {
        const real *row = s->rows + (o * (s->end - s->begin + 1) + k - s->begin) * s->count;
        for (integer j = 0; j < s->u_count; j++) c->ub[o * c->entries + s->places[j]] += row[j];
        for (integer j = s->u_count; j < s->count; j++)
            c->vb[o * c->entries + s->places[j]] += row[j];
    }
}

/* Invert `steps` steps of `advance`, the last of them number `last`. */
void reverse(const scene *c, integer steps, integer opened, integer last, const cotangents *s)
{
    FLUSH
    for (integer k = steps - 1; k >= 0; k--) {
        const integer many = c->together ? c->stages : 1;
        for (integer i = c->stages - many; i >= 0; i -= many)
            reverse_stages(c, i, i + many - 1, k > 0 || opened);
        if (s) add_cotangents(c, s, last - (steps - k));
    }
}

/* Evaluate a law at n elongations with parameters p; rows of results have the stride `stride`, with
   room for a vector beyond the last. */
void evaluate(integer law, integer n, integer stride, const real *p, const real *r, real *f, real *k,
              real *d)
{
    batches(slopes[2 * law], n, stride, r, f, k, d, p, p);
}
