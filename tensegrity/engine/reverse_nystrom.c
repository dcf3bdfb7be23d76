/* The adjoint of explicit Runge-Kutta steps, from the recorded states of their stages: coefficients
   as in `nystrom.c`.  The derivatives of forces by displacements and velocities act like
   springs and dashpots between two sites, of which one without mass stands for the ground and for
   walls. */
#ifdef DIM
#define COORDINATES DIM
#else
#define COORDINATES 1
#endif

typedef struct {
    const real *dt, *nodes, *velocities, *matrix, *positions, *rates; /* times dt or dt^2 */
    const real *path;                /* (stages of all steps, 2, free) u and v */
    const real *stiff, *loss;        /* (stages of all steps, places, coordinates of the difference,
                                        of the force on the first end) derivatives */
    const integer *first, *second;   /* (places) where the rows of both ends begin */
    const real *pull_by;             /* (stages of all steps, pulled, count) derivatives by
                                        parameters */
    const real *u_by, *v_by;         /* (stages of all steps, moved, count) the same */
    const integer *pulled, *moved;   /* entries */
    real *slopes;                    /* (stages of all steps, objectives, entries) receives the
                                        derivatives by accelerations, where it is given */
    real *slope, *of_u, *of_v;       /* scratch (entries), (objectives, stages, entries) twice */
    real *by;                        /* (objectives, count) derivatives by the parameters */
    integer stages, free, places, pulling, moving, count;
} tangents;

/* Stage number j, the s-th of the run: derivatives by its acceleration become those by its state. */
static void reverse_slope(const scene *c, const tangents *t, integer j, integer s, integer o)
{
    const integer n = c->entries, q = t->stages, many = t->count;
    const real *restrict ub = c->ub + o * n, *restrict vb = c->vb + o * n;
    real *restrict slope = t->slope, *restrict by = t->by + o * many;
    real *of_u = t->of_u + (o * q + j) * n, *of_v = t->of_v + (o * q + j) * n;
    EACH(n) slope[i] = t->positions[j] * ub[i] + t->velocities[j] * vb[i];
    for (integer l = j + 1; l < q; l++) {
        const real a = t->matrix[l * q + j], b = t->rates[l * q + j];
        const real *restrict later_u = of_u + (l - j) * n, *restrict later_v = of_v + (l - j) * n;
        if (a != 0) EACH(n) slope[i] += a * later_u[i];
        if (b != 0) EACH(n) slope[i] += b * later_v[i];
    }
    EACH(n) of_u[i] = of_v[i] = 0;
    if (t->slopes) {
        real *restrict given = t->slopes + (s * c->objectives + o) * n;
        EACH(n) given[i] = slope[i];
    }
    scene stage = *c;
    stage.ub = of_u, stage.vb = slope;
    stage.wb += o * n, stage.pb += o * c->wanted * c->stride, stage.gb += o * c->bonds;
    carry(&stage, 1, 0, 0, 1);
    for (integer e = 0; e < t->places; e++)
        for (integer m = 0; m < COORDINATES * COORDINATES; m++) {
            const integer first = t->first[e], second = t->second[e];
            const integer along = m / COORDINATES, from = m % COORDINATES;
            const integer at = (s * t->places + e) * COORDINATES * COORDINATES + m;
            const real bent = c->w[first + from] * slope[first + from] -
                              c->w[second + from] * slope[second + from];
            const real k = bent * t->stiff[at], g = bent * t->loss[at];
            of_u[second + along] += k, of_u[first + along] -= k;
            of_v[second + along] += g, of_v[first + along] -= g;
        }
    for (integer e = 0; e < t->pulling; e++) {
        const integer i = t->pulled[e], at = (s * t->pulling + e) * many;
        for (integer m = 0; m < many; m++) by[m] += slope[i] * c->w[i] * t->pull_by[at + m];
    }
    for (integer e = 0; e < t->moving; e++) {
        const integer i = t->moved[e], at = (s * t->moving + e) * many;
        for (integer m = 0; m < many; m++)
            by[m] += of_u[i] * t->u_by[at + m] + of_v[i] * t->v_by[at + m];
        of_u[i] = of_v[i] = 0;
    }
}

/* The last step is number `last`; `s` has derivatives with respect to the states before. */
void reverse_nystrom(const scene *c, const tangents *t, integer steps, integer last,
                     const cotangents *s)
{
    FLUSH
    const integer n = c->entries, q = t->stages;
    for (integer k = steps - 1; k >= 0; k--) {
        for (integer j = q - 1; j >= 0; j--) {
            const real *restrict here = t->path + 2 * (k * q + j) * t->free;
            EACH(t->free) c->u[i] = here[i];
            place(c);
            evaluated(c, slopes);
            gather(c);
            for (integer o = 0; o < c->objectives; o++) reverse_slope(c, t, j, k * q + j, o);
        }
        for (integer o = 0; o < c->objectives; o++) {
            real *restrict ub = c->ub + o * n, *restrict vb = c->vb + o * n;
            EACH(n) vb[i] += *t->dt * ub[i];
            for (integer j = 0; j < q; j++) {
                const real *restrict of_u = t->of_u + (o * q + j) * n;
                const real *restrict of_v = t->of_v + (o * q + j) * n;
                EACH(n) ub[i] += of_u[i], vb[i] += t->nodes[j] * of_u[i] + of_v[i];
            }
        }
        if (s) add_cotangents(c, s, last - (steps - k));
    }
}
