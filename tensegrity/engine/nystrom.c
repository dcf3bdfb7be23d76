/* Explicit Runge-Kutta-Nystrom steps for u'' = acceleration(u). */
typedef struct {
    const real *nodes, *velocities;  /* (stages) dt times the coefficients */
    const real *matrix, *positions;  /* (stages, stages), (stages) dt^2 times them */
    const real *rates;               /* (stages, stages) dt times the coefficients; if there are
                                        forces that depend on velocity */
    const real *dt;
    real *place, *slopes;            /* scratch: (count), (stages, count) */
    real *speed;                     /* scratch: (count) */
    void *forcing;                   /* of `forced.c` */
    real *travel;                    /* bound on how far any of the first `moving` entries moved */
    integer stages, count, moving;   /* count: entries of u */
} nystrom;

/* place += sum of coefficients times slopes */
static void combine(const nystrom *t, real *restrict place, const real *coefficients, integer stages)
{
    for (integer j = 0; j < stages; j++) {
        const real a = coefficients[j], *restrict slope = t->slopes + j * t->count;
        if (a != 0) EACH(t->count) place[i] += a * slope[i];
    }
}

integer advance_nystrom(const scene *c, const nystrom *t, integer steps, integer opened)
{
    FLUSH
    const integer n = t->count;
    const real dt = *t->dt;
    real *restrict u = c->u, *restrict v = c->v, *restrict place = t->place;
#ifdef FORCES
    note_elongations(c, t->forcing);
#endif
    for (integer k = 0; k < steps; k++) {
        for (integer s = 0; s < t->stages; s++) {
            const real node = t->nodes[s];
            EACH(n) place[i] = u[i] + node * v[i];
            combine(t, place, t->matrix + s * t->stages, s);
#ifdef FORCES
            real *restrict speed = t->speed;
            EACH(n) speed[i] = v[i];
            combine(t, speed, t->rates + s * t->stages, s);
            prescribe(t->forcing, place, speed);
            acceleration(c, place, t->slopes + s * n, n);
            add_forces(c, t->forcing, place, speed, t->slopes + s * n, t->velocities[s]);
#else
            acceleration(c, place, t->slopes + s * n, n);
#endif
        }
        real largest = 0;
        EACH(n) place[i] = dt * v[i];
        combine(t, place, t->positions, t->stages);
        EACH(n) u[i] += place[i];
        for (integer i = 0; i < t->moving; i++) largest = larger(largest, fabs(place[i]));
        *t->travel += largest;
        for (integer j = 0; j < t->stages; j++) {
            const real b = t->velocities[j], *restrict slope = t->slopes + j * n;
            EACH(n) v[i] += b * slope[i];
        }
#ifdef FORCES
        *t->travel += add_lacking(c, t->forcing, dt, t->stages, t->nodes, t->velocities);
        *t->travel += end_step(t->forcing, u, v);
#endif
    }
    return 0;
}
