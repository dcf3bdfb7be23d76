/* Stages of a whole chain, run by run; RUNS(X) lists the kinds of runs. */

/* A kick by a and a drift by b; returns the rate of the energies of changing springs. */
static real stage(const scene *c, real a, real b)
{
    real left[BATCH + 1] = {0}; /* tensions of the last bonds, and that rate */
    for (integer s = 0; s < c->runs; s++)
        switch (c->law[s]) {
#define CASE(K, OWN) case 2 * K + OWN: stage_##K##_##OWN(c, s, a, b, left); break;
            RUNS(CASE)
        }
    integer end = BATCH * c->first[c->runs];
    for (int l = 0; l < BATCH; l++) {
        c->v[end + l] -= a * c->w[end + l] * left[l];
        c->u[end + l] += b * c->v[end + l];
    }
    return left[BATCH];
}
