/* Forces that depend on time, displacement and velocity, and prescribed motions, in the stages of
   an explicit Runge-Kutta method; included before `steps.c`.  FORCES(X) lists the forces with the
   numbers of their parameters, and whether they act on bonds and dissipate: `force_<number>`. */

typedef struct {
    const real *instants;            /* (stages of all steps) */
    const real *parameters;          /* for each force (parameters, places) */
    const integer *place;            /* for each force the sites or bonds on which it acts */
    const integer *first, *begin;    /* (forces + 1) of places, (forces) of parameters */
    const real *prescribed_u, *prescribed_v; /* (stages of all steps, moved) */
    const real *after;               /* (steps, moved) displacements at the ends of steps */
    const real *pull, *pull_rate;    /* (stages of all steps, pulled) forces of time alone */
    const real *prescribed_mass;     /* (moved) */
    const integer *moved, *pulled;   /* entries of u */
    real *sums;                      /* work of drives and forces, loss */
    real *given;                     /* scratch: (bonds or sites) */
    integer moving, pulling, stage, step;
} forcing;

/* The forces number k on `count` places add to the rates `a` of the velocities; returns their
   power. */
#define SITE_FORCE(k, count)                                                                   \
    static real apply_##k(const scene *c, const forcing *d, real t, const real *restrict u,    \
                          const real *restrict v, real *restrict a)                            \
    {                                                                                          \
        const integer n = d->first[k + 1] - d->first[k], *restrict at = d->place + d->first[k]; \
        const real *restrict values = d->parameters + d->begin[k];                             \
        real power = 0;                                                                        \
        EACH(n) {                                                                              \
            real x[] = {u[at[i]], v[at[i]]}, p[count + 1];                                     \
            for (int m = 0; m < count; m++) p[m] = values[m * n + i];                          \
            d->given[i] = force_##k(t, x, p);                                                  \
        }                                                                                      \
        for (integer i = 0; i < n; i++) {                                                      \
            a[at[i]] += c->w[at[i]] * d->given[i];                                             \
            power += c->w[at[i]] == 0 ? 0 : d->given[i] * v[at[i]];                            \
        }                                                                                      \
        return power;                                                                          \
    }

/* A tension, of bonds that join neighbours. */
#define BOND_FORCE(k, count)                                                                   \
    static real apply_##k(const scene *c, const forcing *d, real t, const real *restrict u,    \
                          const real *restrict v, real *restrict a)                            \
    {                                                                                          \
        const integer n = d->first[k + 1] - d->first[k], *restrict at = d->place + d->first[k]; \
        const real *restrict values = d->parameters + d->begin[k];                             \
        real power = 0;                                                                        \
        EACH(n) {                                                                              \
            const integer j = at[i];                                                           \
            real x[] = {u[j + 1] - u[j], v[j + 1] - v[j]}, p[count + 1];                       \
            for (int m = 0; m < count; m++) p[m] = values[m * n + i];                          \
            d->given[i] = force_##k(t, x, p);                                                  \
        }                                                                                      \
        for (integer i = 0; i < n; i++) {                                                      \
            const integer j = at[i];                                                           \
            a[j] += c->w[j] * d->given[i], a[j + 1] -= c->w[j + 1] * d->given[i];              \
            power -= d->given[i] * (v[j + 1] - v[j]);                                          \
        }                                                                                      \
        return power;                                                                          \
    }

#define DEFINE(k, count, on, loses) on##_FORCE(k, count)
FORCES(DEFINE)

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
    for (integer e = 0; e < d->pulling; e++) {
        const integer q = d->pulled[e], at = d->stage * d->pulling + e;
        a[q] += c->w[q] * d->pull[at];
        work -= d->pull_rate[at] * u[q]; /* the rest of their work is added outside */
    }
#define APPLY(k, count, on, loses)                                                             \
    {                                                                                          \
        const real power = apply_##k(c, d, t, u, v, a);                                        \
        if (loses) d->sums[1] -= part * power;                                                 \
        else work += power;                                                                    \
    }
    FORCES(APPLY)
    for (integer e = 0; e < d->moving; e++) { /* the drive bears all other forces on its sites */
        const integer q = d->moved[e];
        work -= d->prescribed_mass[e] * a[q] * v[q];
        a[q] = 0;
    }
    d->sums[0] += part * work;
    d->stage++;
}

static void end_step(forcing *d, real *u, real *v)
{
    const real *at = d->after + d->step++ * d->moving;
    for (integer e = 0; e < d->moving; e++) u[d->moved[e]] = at[e], v[d->moved[e]] = 0;
}
