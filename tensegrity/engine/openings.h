/* Contacts that open: a contact is closed where w = side (elongation - place) > 0; then its
   tension has the part side strength w^exponent.  A bond whose force has several corners is as
   many contacts, contact k bonds + b for corner k of bond b; NaN where a bond has less. */
typedef struct {
    const real *place, *side, *strength; /* (contacts) */
    const real *exponents, *betas;       /* (rows), integral of (y (1 - y))^exponent */
    const real *tables;                  /* (rows, 3, degree + 1), `openings.zetas` */
    const real *nodes, *weights, *offsets; /* (kicks) of a step, over dt, dt and dt^2 */
    const real *dt;
    real *before, *rate_before, *after, *rate_after; /* (contacts) overlap, and rate times dt */
    real *u, *v;                         /* (entries) at the begin of a step */
    real *end_u, *end_v, *end_a;         /* (entries) at its end, before it is corrected */
    const integer *row;                  /* (contacts) of its exponent */
    integer count, bonds, entries, kicks, degree; /* contacts, and those of one corner each */
    integer known; /* of the last step: 0 nothing, 1 where it began in u and v, 2 its overlaps */
    integer begins; /* whether the next step is the first of a run */
    integer alone; /* whether steps have none before and none behind them: each ends as it is shown */
} openings;
