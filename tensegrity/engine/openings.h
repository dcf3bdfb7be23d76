/* Contacts that open: a contact is closed where w = side (elongation - place) > 0; then its
   tension has the part side strength w^exponent.  NaN in all of these where a bond never opens. */
typedef struct {
    const real *place, *side, *strength; /* (contacts) */
    const real *exponents, *betas;       /* (rows), integral of (y (1 - y))^exponent */
    const real *tables;                  /* (rows, 3, degree + 1), `openings.zetas` */
    const real *nodes, *weights, *offsets; /* (kicks) of a step, over dt, dt and dt^2 */
    const real *dt;
    real *before, *rate_before, *after, *rate_after; /* (contacts) overlap, and rate times dt */
    real *a;                             /* (entries) accelerations at the end of a step */
    real *was_u, *was_v;                 /* (entries) u and v there, before they are corrected */
    real *travel;                        /* as in `nystrom`, or none */
    const integer *row;                  /* (contacts) of its exponent */
    integer count, entries, moving, kicks, degree;
} openings;
