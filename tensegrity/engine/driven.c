/* Steps of a splitting with explicit time, included after `steps.c`: prescribed motions and
   forces of some sites, dashpots, springs that change.

   Numbers that depend on time only are computed before, for the kicks and drifts of all steps of
   a call.  A kick leaves in `v` of a prescribed site the impulse of its springs over its mass,
   which times the prescribed velocity is the work of the drive.  Drifts with dashpots solve u' =
   v, m v' = -G v: site by site without dashpots in bonds; with those of a chain by the series of
   the exponential function, in which prescribed velocities are polynomials.  In a network G
   depends on the directions of bonds: the drift is an extrapolated midpoint rule of the method's
   order. */

#define PARTS 8 /* independent sums, which a processor adds at the same time */

typedef struct {
    const real *moved_u, *moved_v;   /* (drifts, moved) after each; (kicks, moved) */
    const real *force, *force_rate;  /* (kicks, forced) */
    const real *numbers;             /* (kicks, columns) parameters of springs, and their rates */
    const real *domain;              /* (kicks, springs, 2) elongations that springs may have */
    const integer *shared_from, *own_from; /* columns of the numbers of the loop's bonds */
    const integer *column;           /* (springs, PARAMETERS) those of each spring */
    const integer *spring;           /* (bonds), in the order of the loop */
    real *shared, *own;              /* of the loop's bonds */
    real *reached;                   /* (springs, 2) smallest and largest elongation so far */
    const real *prescribed_mass;     /* (moved) their masses */
    const real *series;              /* (drifts, moved, degree) of prescribed velocities */
    const real *dissipated;          /* (drifts) loss in dashpots from the ground to those */
    const real *decay, *drift_factor; /* (stages, entries) of v, and of u for v, in a drift */
    const real *mass, *ground, *bond; /* (entries), 0 where prescribed; (entries); (bonds) */
    const integer *moved, *forced;   /* entries of u */
    real *term, *next, *pull, *given; /* scratch: (entries) twice, (entries + 1), (moved, degree) */
    real *sums, *output_sums;        /* work, loss: so far, and in the output */
    const integer *ends;             /* (damped_bonds, 2) first entries of their ends */
    const real *geometry;               /* (damped_bonds, DIM + 2) their geometry D, g, L */
    real *room;                      /* scratch: (levels + 3, 2 entries + 1) */
    real *elongations;               /* scratch: (bonds) elongations, in the order of the loop */
    integer entries, moving, forcing, damped, degree, damped_bonds, levels, bonds, stage, step;
    integer springs, columns, shared_size, own_size;
} drive;

/* Drifts: without dashpots, without those in bonds, with those of a chain, of a network. */
enum { UNDAMPED, DAMPED_SITES, DAMPED_CHAIN, DAMPED_NETWORK };

#if CHANGES
/* Give the bonds of the loop the numbers of the s-th kick. */
static void set_springs(const drive *d, integer s)
{
    const real *restrict numbers = d->numbers + s * d->columns;
    EACH(d->shared_size) d->shared[i] = numbers[d->shared_from[i]];
    EACH(d->own_size) d->own[i] = numbers[d->own_from[i]];
}

#ifdef DIM
#define ELONGATION(j) d->elongations[j]
/* Elongations of the bonds of a network. */
static void find_elongations(const scene *c, const drive *d)
{
    const integer n = c->contacts, walls = c->sites * DIM;
    for (integer b = 0; b < d->bonds; b++) {
        const integer wall = c->from[b] >= walls;
        const real *at = c->u + c->from[b], *to = c->u + c->to[b];
        real place[DIM], w[DIM], along[DIM], *r = d->elongations + b;
        const real g = c->geometry[DIM * n + b], length = c->geometry[(DIM + 1) * n + b];
        AXES(k) place[k] = c->geometry[k * n + b], w[k] = to[k] - (wall ? 0 : at[k]);
        if (wall) wall_contact(place, w, g, length, r, along);
        else pair_contact(place, w, g, length, r, along);
    }
    lengthen(c, c->u);
    for (integer q = 0; q < c->cables; q++)
        for (integer s = c->strand_at[q]; s < c->strand_at[q + 1]; s++) {
            const integer b = c->strand_place[s];
            real *reached = d->reached + 2 * d->spring[b];
            d->elongations[b] = c->average[2 * q];
            *reached = smaller(c->average[2 * q + 1], *reached);
        }
}

/* The sum of the rates of the energies of n bonds of law K with the same numbers p. */
#define RATE(K)                                                                             \
    __attribute__((flatten)) static real rates_##K(                                         \
        const real *restrict elongations, integer n, const real *restrict p)                \
    {                                                                                       \
        real part[BLOCK] = {0}, sum = 0;                                                    \
        integer j = 0;                                                                      \
        for (; j + BLOCK <= n; j += BLOCK)                                                  \
            EACH(BLOCK) part[i] += energy_##K(elongations[j + i], p);                       \
        EACH(n - j) part[i] += energy_##K(elongations[j + i], p);                           \
        for (int i = 0; i < BLOCK; i++) sum += part[i];                                     \
        return sum;                                                                         \
    }
LAWS(RATE)

/* Rate of the energy of all bonds at the elongations found, in the s-th kick. */
static real power_of(const scene *c, const drive *d, integer s)
{
    const real *numbers = d->numbers + s * d->columns;
    real p[PARAMETERS + 1], sum = 0;
    for (integer run = 0; run < c->runs; run++)
        for (integer j = c->first[run], next; j < c->first[run + 1]; j = next) {
            const integer spring = d->spring[j], *column = d->column + spring * PARAMETERS;
            for (next = j + 1; next < c->first[run + 1] && d->spring[next] == spring;) next++;
            for (int i = 0; i < PARAMETERS; i++) p[i] = numbers[column[i]];
            switch (c->law[run] / 4) {
#define CASE_OF(K) case K: sum += rates_##K(d->elongations + j, next - j, p); break;
                LAWS(CASE_OF)
            }
        }
    return sum;
}
#else
#define ELONGATION(j) (u[(j) + 1] - u[j])
#define find_elongations(c, d)
#endif

/* Note that a spring has had elongations from `low` to `high`; whether it may have them. */
static int may_reach(const drive *d, integer s, integer spring, real low, real high)
{
    real *reached = d->reached + 2 * spring;
    const real *domain = d->domain + 2 * (s * d->springs + spring);
    reached[0] = smaller(low, reached[0]), reached[1] = larger(high, reached[1]);
    return low > domain[0] && high < domain[1];
}

/* Note the elongations of a kick; whether all springs may have them. */
static int may_span(const scene *c, const drive *d, integer s)
{
    const real *restrict u = c->u;
    int may = 1;
    find_elongations(c, d);
    for (integer run = 0; run < c->runs; run++) {
        const integer end = c->first[run + 1];
        integer j = c->first[run];
        if (c->law[run] & 1) { /* bonds with numbers of their own */
            for (; j < end; j++) may &= may_reach(d, s, d->spring[j], ELONGATION(j), ELONGATION(j));
            continue;
        }
        real low[BLOCK], high[BLOCK];
        for (int i = 0; i < BLOCK; i++) low[i] = INFINITY, high[i] = -INFINITY;
#define SPAN(n)                                                                             \
    EACH(n) {                                                                               \
        const real r = ELONGATION(j + i);                                                   \
        low[i] = r < low[i] ? r : low[i];                                                   \
        high[i] = r > high[i] ? r : high[i];                                                \
    }
        for (; j + BLOCK <= end; j += BLOCK) SPAN(BLOCK)
        SPAN(end - j)
        for (int n = BLOCK / 2; n; n /= 2)
            EACH(n) {
                low[i] = low[i + n] < low[i] ? low[i + n] : low[i];
                high[i] = high[i + n] > high[i] ? high[i + n] : high[i];
            }
        may &= may_reach(d, s, d->spring[c->first[run]], *low, *high);
    }
    (void)u;
    return may;
}
#endif

static real energy_of(const drive *d, const real *restrict v)
{
    const real *restrict m = d->mass;
    real part[PARTS] = {0}, sum = 0;
    integer i = 0;
    for (; i + PARTS <= d->entries; i += PARTS)
        for (int l = 0; l < PARTS; l++) part[l] += m[i + l] * v[i + l] * v[i + l];
    for (; i < d->entries; i++) sum += m[i] * v[i] * v[i];
    for (int l = 0; l < PARTS; l++) sum += part[l];
    return sum / 2;
}

/* A drift with dashpots from the sites to the ground. */
static void drift_damped_sites(const scene *c, const drive *d, integer s, integer i0)
{
    const integer n = d->entries;
    const real *restrict decay = d->decay + i0 * n;
    const real *restrict drift_factor = d->drift_factor + i0 * n;
    real *restrict u = c->u, *restrict v = c->v;
    const real before = energy_of(d, v);
    EACH(n) u[i] += drift_factor[i] * v[i], v[i] *= decay[i];
    d->sums[1] += before - energy_of(d, v);
    if (d->moving) d->sums[0] += d->dissipated[s], d->sums[1] += d->dissipated[s];
#ifdef DIM
    real farthest = 0;
    for (integer i = 0; i < n; i++)
        if (v[i] != 0) farthest = larger(farthest, fabs(drift_factor[i] / decay[i] * v[i]));
    *c->travel += farthest;
#endif
}

#ifndef DIM
/* A drift with dashpots in the bonds of a chain too. */
static void drift_damped_chain(const scene *c, const drive *d, integer s, real b)
{
    const integer n = d->entries, count = d->degree;
    real *restrict u = c->u, *restrict v = c->v, *restrict y = d->term, *restrict next = d->next;
    real *restrict pull = d->pull;
    const real *restrict w = c->w, *restrict ground = d->ground, *restrict bond = d->bond;
    const real *series = d->series + s * d->moving * count, before = energy_of(d, v);
    EACH(n) y[i] = v[i], v[i] = 0;
    for (integer k = 0; k < count; k++) {
        const real part = b / (k + 1);
        for (integer e = 0; e < d->moving; e++) y[d->moved[e]] = series[e * count + k];
        pull[0] = pull[n] = 0;
        EACH(n - 1) pull[i + 1] = bond[i] * (y[i + 1] - y[i]);
        for (integer e = 0; e < d->moving; e++) {
            const integer q = d->moved[e];
            d->given[e * count + k] = pull[q] - pull[q + 1] + ground[q] * y[q];
        }
        EACH(n) {
            v[i] += y[i];
            u[i] += part * y[i];
            next[i] = part * w[i] * (pull[i + 1] - pull[i] - ground[i] * y[i]);
        }
        real *swap = y;
        y = next, next = swap;
    }
    real paid = 0; /* work of drives against dashpots */
    for (integer e = 0; e < d->moving; e++)
        for (integer k = 0; k < count; k++)
            for (integer l = 0; l < count; l++)
                paid += b * series[e * count + k] * d->given[e * count + l] / (k + l + 1);
    d->sums[0] += paid;
    d->sums[1] += before - energy_of(d, v) + paid;
}
#endif

#ifdef DIM
/* Rates of displacements and velocities after a fraction `tau` of a drift, then that of the work of
   drives against dashpots. */
static void resisted(const scene *c, const drive *d, integer s, real tau, real *y, real *rate)
{
    const integer n = d->entries, count = d->degree;
    const real *restrict u = y, *series = d->series + s * d->moving * count;
    real *restrict v = y + n, *restrict pull = rate + n;
    for (integer e = 0; e < d->moving; e++) {
        real value = 0;
        for (integer k = count - 1; k >= 0; k--) value = value * tau + series[e * count + k];
        v[d->moved[e]] = value;
    }
    EACH(n) rate[i] = v[i], pull[i] = -d->ground[i] * v[i];
    for (integer q = 0; q < d->damped_bonds; q++) {
        const integer i = d->ends[2 * q], j = d->ends[2 * q + 1];
        const real *place = d->geometry + q * (DIM + 2);
        real w[DIM], along[DIM], r, speed = 0;
        AXES(k) w[k] = u[j + k] - u[i + k];
        pair_contact(place, w, place[DIM], place[DIM + 1], &r, along);
        AXES(k) speed += along[k] * (v[j + k] - v[i + k]);
        speed *= d->bond[q];
        AXES(k) pull[i + k] += speed * along[k], pull[j + k] -= speed * along[k];
    }
    real paid = 0;
    for (integer e = 0; e < d->moving; e++) paid -= v[d->moved[e]] * pull[d->moved[e]];
    EACH(n) pull[i] *= c->w[i];
    for (integer e = 0; e < d->moving; e++) pull[d->moved[e]] = 0;
    rate[2 * n] = paid;
}

/* A drift with dashpots in the bonds of a network: midpoint rules of 2, 4, ... steps, whose errors
   are series in the square of the step, extrapolated. */
static void drift_damped_network(const scene *c, const drive *d, integer s, real b)
{
    const integer n = d->entries, all = 2 * n + 1;
    real *restrict rows = d->room, *restrict old = rows + d->levels * all;
    real *restrict now = old + all, *restrict rate = now + all, farthest = 0;
    const real before = energy_of(d, c->v);
    for (integer l = 0; l < d->levels; l++) {
        const integer steps = 2 * (l + 1);
        const real h = b / steps;
        EACH(n) old[i] = c->u[i], old[n + i] = c->v[i];
        old[2 * n] = 0;
        resisted(c, d, s, 0, old, rate);
        EACH(all) now[i] = old[i] + h * rate[i];
        for (integer k = 1; k <= steps; k++) {
            resisted(c, d, s, (real)k / steps, now, rate);
            if (l == d->levels - 1) {
                real way = 0;
                EACH(n) way = larger(way, fabs(h * rate[i]));
                farthest += way;
            }
            if (k == steps) break;
            EACH(all) {
                const real next = old[i] + 2 * h * rate[i];
                old[i] = now[i], now[i] = next;
            }
        }
        EACH(all) now[i] = (old[i] + now[i] + h * rate[i]) / 2;
        for (integer k = 0; k < l; k++) { /* Neville's scheme, in place */
            const real finer = (real)(l + 1) / (l - k), factor = 1 / (finer * finer - 1);
            real *restrict row = rows + k * all;
            EACH(all) {
                const real last = row[i];
                row[i] = now[i], now[i] += factor * (now[i] - last);
            }
        }
        EACH(all) rows[l * all + i] = now[i];
    }
    EACH(n) c->u[i] = now[i], c->v[i] = now[n + i];
    for (integer e = 0; e < d->moving; e++) c->v[d->moved[e]] = 0;
    d->sums[0] += now[2 * n];
    d->sums[1] += before - energy_of(d, c->v) + now[2 * n];
    *c->travel += 2 * farthest; /* velocities of substeps, not of all instants */
}
#endif

/* The s-th kick by a, and the drift by b after it, the i-th of a step; 1 if a spring locked. */
static int driven_stage(scene *c, const drive *d, integer s, integer i, real a, real b)
{
    real *u = c->u, *v = c->v;
    const real straight = d->damped ? 0 : b; /* of the drift, where `stage` does it */
    for (integer e = 0; e < d->forcing; e++) {
        const integer q = d->forced[e], at = s * d->forcing + e;
        v[q] += a * c->w[q] * d->force[at];
        d->sums[0] -= a * d->force_rate[at] * u[q];
    }
    for (integer e = 0; e < d->moving; e++) v[d->moved[e]] = 0, d->given[e] = u[d->moved[e]];
    CLOSE_RING(c, u, v)
#if CHANGES
    if (!may_span(c, d, s)) return 1;
    set_springs(d, s);
#ifdef DIM
    d->sums[0] += a * power_of(c, d, s);
    stage(c, a, straight);
#else
    d->sums[0] += a * stage(c, a, straight);
#endif
#else
    stage(c, a, straight);
#endif
    for (integer e = 0; e < d->moving; e++) {
        d->sums[0] -= d->prescribed_mass[e] * v[d->moved[e]] * d->moved_v[s * d->moving + e];
        v[d->moved[e]] = 0;
    }
    if (b == 0) return 0;
    if (d->damped == DAMPED_SITES) drift_damped_sites(c, d, s, i);
#ifndef DIM
    if (d->damped == DAMPED_CHAIN) drift_damped_chain(c, d, s, b);
#else
    if (d->damped == DAMPED_NETWORK) drift_damped_network(c, d, s, b);
#endif
    for (integer e = 0; e < d->moving; e++) u[d->moved[e]] = d->moved_u[s * d->moving + e];
#ifdef DIM
    real farthest = 0;
    for (integer e = 0; e < d->moving; e++)
        farthest = larger(farthest, fabs(u[d->moved[e]] - d->given[e]));
    *c->travel += farthest;
#endif
    return 0;
}

/* As the functions of `steps.c`, from kick number d->stage on, which is advanced; 1 where a spring
   reached the end of its domain. */
integer advance_driven(const scene *given, drive *d, integer steps, integer opened)
{
    FLUSH
    scene here = *given;
    ALL_MAY_MOVE(here)
    for (integer k = 0; k < steps; k++)
        for (integer i = 0; i < here.stages; i++, d->stage++) {
            const real a = KICK(&here, i, k > 0 || opened);
            if (driven_stage(&here, d, d->stage, i, a, here.drifts[i])) return 1;
        }
    return 0;
}

/* The output state has its own sums. */
integer postprocess_driven(const scene *given, drive *d, real *u, real *v)
{
    FLUSH
    scene copy = *given;
    drive alone = *d;
    copy.u = u, copy.v = v, alone.sums = d->output_sums;
    ALL_MAY_MOVE(copy)
    for (int i = 0; i < 2; i++) d->output_sums[i] = d->sums[i];
    return copy.closing && driven_stage(&copy, &alone, d->stage, 0, copy.kicks[copy.stages], 0);
}
