/* The adjoint of explicit Runge-Kutta steps of a chain, from the recorded states of their stages:
   coefficients as in `nystrom` of `steps.c`.  The derivatives of forces by displacements and
   velocities act like springs and dashpots between two entries, of which one without mass stands
   for the ground. */
typedef struct {
    const real *dt, *nodes, *velocities, *matrix, *positions, *rates; /* times dt or dt^2 */
    const real *path;                /* (stages of all steps, 2, sites) u and v */
    const real *stiff, *loss;        /* (stages of all steps, places) derivatives of the tensions */
    const integer *first, *second;   /* (places) entries */
    const real *pull_by;             /* (stages of all steps, pulled) derivatives by a parameter */
    const real *u_by, *v_by;         /* (stages of all steps, moved) the same */
    const integer *pulled, *moved;   /* entries */
    real *slopes;                    /* (stages of all steps, objectives, entries) receives the
                                        derivatives by accelerations, where it is given */
    real *slope, *of_u, *of_v;       /* scratch (entries), (stages, entries) twice */
    real *by;                        /* (objectives) derivatives by the parameter */
    integer stages, sites, places, pulling, moving;
} tangents;

/* Stage number j, the s-th of the run: derivatives by its acceleration become those by its state. */
static void reverse_slope(const scene *c, const tangents *t, integer j, integer s, integer o)
{
    const integer n = c->entries, q = t->stages;
    const real *restrict ub = c->ub + o * n, *restrict vb = c->vb + o * n;
    real *restrict slope = t->slope, *of_u = t->of_u + j * n, *of_v = t->of_v + j * n;
    EACH(n) slope[i] = t->positions[j] * ub[i] + t->velocities[j] * vb[i];
    for (integer l = j + 1; l < q; l++) {
        const real a = t->matrix[l * q + j], b = t->rates[l * q + j];
        const real *restrict later_u = t->of_u + l * n, *restrict later_v = t->of_v + l * n;
        if (a != 0) EACH(n) slope[i] += a * later_u[i];
        if (b != 0) EACH(n) slope[i] += b * later_v[i];
    }
    EACH(n) of_u[i] = of_v[i] = 0;
    if (t->slopes) {
        real *restrict given = t->slopes + (s * c->objectives + o) * n;
        EACH(n) given[i] = slope[i];
    }
    scene stage = of_stage(c, j);
    stage.ub = of_u, stage.vb = slope;
    stage.wb += o * n, stage.pb += o * c->wanted * c->stride;
    carry(&stage, 1, 0, 0, 1);
    for (integer e = 0; e < t->places; e++) {
        const integer first = t->first[e], second = t->second[e];
        const real bent = c->w[first] * slope[first] - c->w[second] * slope[second];
        const real k = bent * t->stiff[s * t->places + e], g = bent * t->loss[s * t->places + e];
        of_u[second] += k, of_u[first] -= k;
        of_v[second] += g, of_v[first] -= g;
    }
    for (integer e = 0; e < t->pulling; e++) {
        const integer i = t->pulled[e];
        t->by[o] += slope[i] * c->w[i] * t->pull_by[s * t->pulling + e];
    }
    for (integer e = 0; e < t->moving; e++) {
        const integer i = t->moved[e], at = s * t->moving + e;
        t->by[o] += of_u[i] * t->u_by[at] + of_v[i] * t->v_by[at];
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
        for (integer j = 0; j < q; j++) {
            const real *restrict here = t->path + 2 * (k * q + j) * t->sites;
            EACH(t->sites) c->u[i] = here[i];
            const scene stage = of_stage(c, j);
            place(&stage);
            evaluated(&stage, slopes);
            gather(&stage);
        }
        for (integer o = 0; o < c->objectives; o++) {
            real *restrict ub = c->ub + o * n, *restrict vb = c->vb + o * n;
            for (integer j = q - 1; j >= 0; j--) reverse_slope(c, t, j, k * q + j, o);
            EACH(n) vb[i] += *t->dt * ub[i];
            for (integer j = 0; j < q; j++) {
                const real *restrict of_u = t->of_u + j * n, *restrict of_v = t->of_v + j * n;
                EACH(n) ub[i] += of_u[i], vb[i] += t->nodes[j] * of_u[i] + of_v[i];
            }
        }
        if (s) add_cotangents(c, s, last - (steps - k));
    }
}
