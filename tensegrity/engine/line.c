/* Stages of a whole chain, run by run; RUNS(X) lists the kinds of runs.

   A wave that has not arrived at a site has not changed its velocity from exactly 0: behind the
   wave subnormal numbers are flushed.  A stage moves the wave by one site at most, so the sites
   beyond are left out for some steps; then the place is found anew.  No bit depends on this. */

#define LOOKING 12

#ifndef STEPPER
/* A kick by a and a drift by b; returns the rate of the energies of changing springs. */
real stage(const scene *c, real a, real b)
{
    real left[BATCH + 1] = {0}; /* tensions of the last bonds, and that rate */
    const integer end = BATCH * c->first[c->runs], active = c->active ? *c->active : end;
    close_ring(c, c->u, c->v);
    for (integer s = 0; s < c->runs && BATCH * c->first[s] < active; s++)
        switch (c->law[s]) {
#define CASE(K, OWN) case 2 * K + OWN: stage_##K##_##OWN(c, s, a, b, active, left); break;
            RUNS(CASE)
        }
    for (int l = 0; l < BATCH && active >= end; l++) {
        if (c->stretch) { /* the last bond of a ring pulls on the first site */
            const real kick = a * c->w[l] * left[l];
            c->v[l] -= kick;
            c->u[l] -= b * kick;
        } else {
            c->v[end + l] -= a * c->w[end + l] * left[l];
            c->u[end + l] += b * c->v[end + l];
        }
    }
    close_ring(c, c->u, c->v);
    return left[BATCH];
}
#endif

/* After a step: find the entries that may move in the next ones. */
static void narrow(const scene *c)
{
    if (!c->active || --c->active[1] > 0) return;
    const integer end = BATCH * (c->first[c->runs] + 1), known = *c->active;
    integer moving = known < end ? known : end;
    while (moving && c->v[moving - 1] == 0) moving--;
    c->active[0] = moving + BATCH * (LOOKING * (c->stages + 2) + 3);
    c->active[1] = LOOKING;
}
#define NARROW(c) narrow(c);
