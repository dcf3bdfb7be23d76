/* Forces that depend on time, displacement and velocity, and prescribed motions, in the stages of
   an explicit Runge-Kutta method; included before `steps.c`.  FORCES(X) lists the forces with the
   numbers of their parameters and results, whether they act on bonds, and what becomes of their
   work (0 work on the scene, 1 loss, 2 energy of the scene): `force_<number>`. */

typedef struct {
    const real *instants;            /* (stages of all steps) */
    const real *parameters;          /* for each force (parameters, places) */
    const real *none;                /* (sites, coordinates) zeros */
    const integer *straight;         /* (forces) whether its places are consecutive */
    const integer *place;            /* for each force the sites or bonds on which it acts */
    const integer *ends;             /* (places, 2) of a network, where the rows of a bond begin; a
                                        wall comes first */
    const real *geometry;            /* (places, DIM + 2) of a network, D, g, L */
    const integer *first, *begin;    /* (forces + 1) of places, (forces) of parameters */
    const real *prescribed_u, *prescribed_v; /* (stages of all steps, moved) */
    const real *after;               /* (steps, moved) displacements at the ends of steps */
    const real *pull, *pull_rate;    /* (stages of all steps, pulled) forces of time alone */
    const real *prescribed_mass;     /* (moved) */
    real *path;                      /* (stages of all steps, 2, entries) receives u and v of the
                                        stages, where it is given */
    const integer *moved, *pulled;   /* entries of u */
    real *sums;                      /* work of drives and forces, loss */
    real *given;                     /* scratch: results on all sites, or of all bonds */
    const real *onset;               /* (places) elongation where a contact closes, else NaN */
    const real *alpha, *zeta;        /* (forces), (forces, degree + 1) power of the overlap with
                                        which the force then begins, and Hurwitz' zeta function */
    real *before;                    /* (places, 2) elongations and rates before the step */
    const real *unit;                /* (rows) of bonds with mass, 0 where `w` is 0, else 1 */
    real *together;                  /* scratch (rows) of these: all forces but those of springs */
    const real *prescribed_a;        /* (stages of all steps, moved) of bonds with mass */
    const integer *tied;             /* (ties, 2) number of a prescribed entry, and a free entry
                                        with which it shares the mass of a bond */
    const real *tied_mass;           /* (ties) entries of the mass matrix */
    integer moving, pulling, stage, step, entries, places, degree, ties;
} forcing;

#ifdef DIM
#define COORDINATES DIM
#else
#define COORDINATES 1
#endif

/* The sum of products of forces with velocities, of which the second is subtracted if given. */
static real power_of_forces(integer n, const real *restrict f, const real *restrict plus,
                            const real *restrict minus)
{
    real part[8] = {0}, sum = 0;
    integer i = 0;
    for (; i + 8 <= n; i += 8)
        for (int l = 0; l < 8; l++) part[l] += f[i + l] * (plus[i + l] - minus[i + l]);
    for (; i < n; i++) sum += f[i] * (plus[i] - minus[i]);
    for (int l = 0; l < 8; l++) sum += part[l];
    return sum;
}

/* Each force has a function apply_<number>, which adds it to the rates `a` of the velocities and
   returns its power; the places of a `straight` one are consecutive. */

/* On sites. */
#define SITE_FORCE(k, count, results)                                                          \
    static real apply_##k(const scene *c, const forcing *d, real t, const real *restrict u,    \
                          const real *restrict v, real *restrict a)                            \
    {                                                                                          \
        const integer n = d->first[k + 1] - d->first[k], *restrict at = d->place + d->first[k]; \
        const real *restrict values = d->parameters + d->begin[k], *restrict w = c->w;         \
        real *restrict given = d->given, power = 0;                                            \
        EACH(n) {                                                                              \
            real x[2 * COORDINATES + 1], f[COORDINATES], p[count + 1], square = 0;             \
            for (int j = 0; j < COORDINATES; j++) {                                            \
                x[j] = u[at[i] * COORDINATES + j];                                             \
                const real speed = x[COORDINATES + j] = v[at[i] * COORDINATES + j];            \
                square += speed * speed;                                                       \
            }                                                                                  \
            x[2 * COORDINATES] = sqrt(square);                                                 \
            for (int m = 0; m < count; m++) p[m] = values[m * n + i];                          \
            force_##k(t, x, p, f);                                                             \
            for (int j = 0; j < COORDINATES; j++) {                                            \
                const real free = w[at[i] * COORDINATES + j] == 0 ? 0 : f[j];                  \
                given[i * COORDINATES + j] = free;                                             \
            }                                                                                  \
        }                                                                                      \
        if (d->straight[k]) {                                                                  \
            const integer first = *at * COORDINATES, all = n * COORDINATES;                    \
            EACH(all) a[first + i] += w[first + i] * given[i];                                 \
            return power_of_forces(all, given, v + first, d->none);                            \
        }                                                                                      \
        for (integer i = 0; i < n; i++)                                                        \
            for (int j = 0; j < COORDINATES; j++) {                                            \
                const integer q = at[i] * COORDINATES + j;                                     \
                a[q] += w[q] * given[i * COORDINATES + j];                                     \
                power += given[i * COORDINATES + j] * v[q];                                    \
            }                                                                                  \
        return power;                                                                          \
    }

#ifdef DIM
/* Tensions of contacts, and forces along their slip, of the second end relative to the first. */
#define BOND_FORCE(k, count, results)                                                          \
    static real apply_##k(const scene *c, const forcing *d, real t, const real *restrict u,    \
                          const real *restrict v, real *restrict a)                            \
    {                                                                                          \
        const integer n = d->first[k + 1] - d->first[k], walls = c->sites * DIM;               \
        const integer *ends = d->ends + 2 * d->first[k];                                       \
        const real *values = d->parameters + d->begin[k];                                      \
        const real *geometry = d->geometry + (DIM + 2) * d->first[k];                          \
        real power = 0;                                                                        \
        for (integer i = 0; i < n; i++, ends += 2, geometry += DIM + 2) {                      \
            const integer from = ends[0], to = ends[1], wall = from >= walls;                  \
            real along[DIM], w[DIM], speed[DIM], x[3] = {0}, f[2] = {0}, p[count + 1];         \
            AXES(j) w[j] = u[to + j] - (wall ? 0 : u[from + j]);                               \
            AXES(j) speed[j] = v[to + j] - (wall ? 0 : v[from + j]);                           \
            if (wall) wall_contact(geometry, w, geometry[DIM], geometry[DIM + 1], x, along);   \
            else pair_contact(geometry, w, geometry[DIM], geometry[DIM + 1], x, along);        \
            AXES(j) x[1] += along[j] * speed[j];                                               \
            if (results > 1) {                                                                 \
                AXES(j) speed[j] -= x[1] * along[j];                                           \
                AXES(j) x[2] += speed[j] * speed[j];                                           \
                x[2] = sqrt(x[2]);                                                             \
            }                                                                                  \
            for (int m = 0; m < count; m++) p[m] = values[m * n + i];                          \
            force_##k(t, x, p, f);                                                             \
            const real per_speed = x[2] > 0 ? f[1] / x[2] : 0;                                 \
            AXES(j) {                                                                          \
                const real force = per_speed * speed[j] - f[0] * along[j];                     \
                a[to + j] += c->w[to + j] * force, a[from + j] -= c->w[from + j] * force;      \
            }                                                                                  \
            power += f[1] * x[2] - f[0] * x[1];                                                \
        }                                                                                      \
        return power;                                                                          \
    }
#else
/* A tension, of bonds that join neighbours. */
#define BOND_FORCE(k, count, results)                                                          \
    static real apply_##k(const scene *c, const forcing *d, real t, const real *restrict u,    \
                          const real *restrict v, real *restrict a)                            \
    {                                                                                          \
        const integer n = d->first[k + 1] - d->first[k], *restrict at = d->place + d->first[k]; \
        const real *restrict values = d->parameters + d->begin[k], *restrict w = c->w;         \
        real *restrict given = d->given, power = 0;                                            \
        EACH(n) {                                                                              \
            const integer j = at[i];                                                           \
            real x[] = {u[j + 1] - u[j], v[j + 1] - v[j], 0}, p[count + 1];                    \
            for (int m = 0; m < count; m++) p[m] = values[m * n + i];                          \
            force_##k(t, x, p, given + i);                                                     \
        }                                                                                      \
        if (d->straight[k]) {                                                                  \
            const integer j = *at;                                                             \
            EACH(n) a[j + i] += w[j + i] * given[i];                                           \
            EACH(n) a[j + i + 1] -= w[j + i + 1] * given[i];                                   \
            return -power_of_forces(n, given, v + j + 1, v + j);                               \
        }                                                                                      \
        for (integer i = 0; i < n; i++) {                                                      \
            const integer j = at[i];                                                           \
            a[j] += w[j] * given[i], a[j + 1] -= w[j + 1] * given[i];                          \
            power -= given[i] * (v[j + 1] - v[j]);                                             \
        }                                                                                      \
        return power;                                                                          \
    }
#endif

#define DEFINE(k, count, results, on, becomes, begins) on##_FORCE(k, count, results)
FORCES(DEFINE)

#define COUNTED(k, count, results, on, becomes, begins) + count
enum { MOST_NUMBERS = 1 FORCES(COUNTED) };

/* Elongation and rate of place e, and the direction of its bond; where the rows of its ends begin. */
static void place_of(const scene *c, const forcing *d, integer e, integer *ends, real *along, real *x)
{
#ifdef DIM
    const real *geometry = d->geometry + (DIM + 2) * e;
    ends[0] = d->ends[2 * e], ends[1] = d->ends[2 * e + 1];
    const integer wall = ends[0] >= c->sites * DIM;
    real w[DIM];
    AXES(j) w[j] = c->u[ends[1] + j] - (wall ? 0 : c->u[ends[0] + j]);
    if (wall) wall_contact(geometry, w, geometry[DIM], geometry[DIM + 1], x, along);
    else pair_contact(geometry, w, geometry[DIM], geometry[DIM + 1], x, along);
    x[1] = 0;
    AXES(j) x[1] += along[j] * (c->v[ends[1] + j] - (wall ? 0 : c->v[ends[0] + j]));
#else
    ends[0] = d->place[e], ends[1] = ends[0] + 1, *along = 1;
    x[0] = c->u[ends[1]] - c->u[ends[0]], x[1] = c->v[ends[1]] - c->v[ends[0]];
#endif
}

/* The impulse over dt that steps of a rule lack of the force of contact e, which begins at x of
   the step with the overlap's rate q: `derivations.openings`. */
static real lacking(const forcing *d, integer e, real x, real q, real dt, integer stages,
                    const real *nodes, const real *weights, int *becomes)
{
    real strength = 0, alpha = 0, sum = 0, p[MOST_NUMBERS];
    const real *zeta = 0;
#define BEGINS(k, count, results, on, to, begins)                                              \
    if (begins && e >= d->first[k] && e < d->first[k + 1]) {                                   \
        const integer n = d->first[k + 1] - d->first[k], i = e - d->first[k];                  \
        for (int m = 0; m < count; m++) p[m] = d->parameters[d->begin[k] + m * n + i];         \
        strength = onset_##k(q, p), alpha = d->alpha[k];                                       \
        zeta = d->zeta + k * (d->degree + 1), *becomes = to;                                   \
    }
    FORCES(BEGINS)
    if (!zeta) return 0;
    for (integer s = 0; s < stages; s++) {
        const real node = nodes[s] / dt, far = (node > 1 ? 1 : node) - x; /* 1 but for round-off */
        const real fraction = far + 1 - ceil(far), t = 2 * fraction - 1;
        real value = 0;
        for (integer m = d->degree; m >= 0; m--) value = value * t + zeta[m];
        sum += weights[s] / dt * (value + pow(fraction, alpha));
    }
    return -strength * pow(q * dt, alpha) * sum;
}

static void note_elongations(const scene *c, const forcing *d)
{
    integer ends[2];
    real along[COORDINATES];
    for (integer e = 0; e < d->places; e++)
        if (d->onset[e] == d->onset[e]) place_of(c, d, e, ends, along, d->before + 2 * e);
}

/* Add what the rule lacks of the forces of contacts that closed in a step; the largest change of a
   displacement. */
static real add_lacking(const scene *c, const forcing *d, real dt, integer stages,
                        const real *nodes, const real *weights)
{
    real largest = 0;
    for (integer e = 0; e < d->places; e++) {
        if (d->onset[e] != d->onset[e]) continue;
        real along[COORDINATES], x[3], *before = d->before + 2 * e;
        integer ends[2];
        place_of(c, d, e, ends, along, x);
        const real w0 = d->onset[e] - before[0], w1 = d->onset[e] - x[0];
        const real d0 = -dt * before[1], d1 = -dt * x[1];
        before[0] = x[0], before[1] = x[1];
        if (!(w0 <= 0 && w1 > 0)) continue;
        const real path[4] = {w0, d0, 3 * (w1 - w0) - 2 * d0 - d1, 2 * (w0 - w1) + d0 + d1};
        const real at = root_between(path, 0, 1), q = incline(path, at) / dt;
        if (!(q > 0)) continue;
        int becomes = 0;
        const real pull = dt * lacking(d, e, at, q, dt, stages, nodes, weights, &becomes);
#ifdef DIM
        if (d->together) {
            real *to = d->together;
            EACH(c->rows * DIM) to[i] = 0;
            AXES(j) to[ends[0] + j] += pull * along[j], to[ends[1] + j] -= pull * along[j];
            COUPLE(c, to, DIM)
            for (integer i = 0; i < c->rows * DIM; i++) {
                const real change = c->w[i] * to[i];
                c->v[i] += change, c->u[i] += (1 - at) * dt * change;
                if (i < d->entries) largest = larger(largest, fabs((1 - at) * dt * change));
            }
        } else
#endif
        for (integer end = 0; end < 2; end++)
            for (integer j = 0; j < COORDINATES; j++) {
                const integer row = ends[end] + j;
                const real change = (end ? -pull : pull) * c->w[row] * along[j];
                c->v[row] += change, c->u[row] += (1 - at) * dt * change;
                if (row < d->entries) largest = larger(largest, fabs((1 - at) * dt * change));
            }
        d->sums[becomes == 1] += becomes == 1 ? -pull * q : becomes == 0 ? pull * q : 0;
        place_of(c, d, e, ends, along, before);
    }
    return largest;
}

/* Displacements and velocities of prescribed sites in a stage. */
static void prescribe(const forcing *d, real *u, real *v)
{
    const real *at = d->prescribed_u + d->stage * d->moving;
    const real *speed = d->prescribed_v + d->stage * d->moving;
    for (integer e = 0; e < d->moving; e++) u[d->moved[e]] = at[e], v[d->moved[e]] = speed[e];
}

/* Add the forces of a stage to the rates of the velocities, and their work, of which the stage
   counts for a time `part`. */
static void add_forces(const scene *c, forcing *d, const real *u, const real *v, real *a, real part)
{
    const real t = d->instants[d->stage];
    real work = 0;
    if (d->path) {
        real *here = d->path + 2 * d->stage * d->entries;
        EACH(d->entries) here[i] = u[i], here[d->entries + i] = v[i];
    }
    const scene *of = c;
    real *to = a;
#ifdef DIM
    scene apart = *c;
    if (d->together) {
        apart.w = d->unit, of = &apart, to = d->together;
        EACH(c->rows * DIM) to[i] = 0;
        for (integer k = 0; k < d->ties; k++)
            to[d->tied[2 * k + 1]] -=
                d->tied_mass[k] * d->prescribed_a[d->stage * d->moving + d->tied[2 * k]];
    }
#endif
    for (integer e = 0; e < d->pulling; e++) {
        const integer q = d->pulled[e], at = d->stage * d->pulling + e;
        to[q] += of->w[q] * d->pull[at];
        work -= d->pull_rate[at] * u[q]; /* the rest of their work is added outside */
    }
#define APPLY(k, count, results, on, becomes, begins)                                                 \
    {                                                                                          \
        const real power = apply_##k(of, d, t, u, v, to);                                      \
        if (becomes == 1) d->sums[1] -= part * power;                                           \
        else if (becomes == 0) work += power;                                                  \
    }
    FORCES(APPLY)
#ifdef DIM
    if (d->together) {
        COUPLE(c, to, DIM)
        EACH(c->rows * DIM) a[i] += c->w[i] * to[i];
    }
    for (integer k = 0; k < d->ties; k++)
        work += d->tied_mass[k] * a[d->tied[2 * k + 1]] * v[d->moved[d->tied[2 * k]]];
#endif
    for (integer e = 0; e < d->moving; e++) { /* the drive bears all other forces on its sites */
        const integer q = d->moved[e];
        work -= d->prescribed_mass[e] * a[q] * v[q];
        a[q] = 0;
    }
    d->sums[0] += part * work;
    d->stage++;
}

/* The largest displacement of a prescribed site in a step. */
static real end_step(forcing *d, real *u, real *v)
{
    const real *at = d->after + d->step++ * d->moving;
    real largest = 0;
    for (integer e = 0; e < d->moving; e++) {
        const integer q = d->moved[e];
        largest = larger(largest, fabs(at[e] - u[q]));
        u[q] = at[e], v[q] = 0;
    }
    return largest;
}
