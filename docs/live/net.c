/* Whole steps of a network, after the text of its loop.  Dashpots to the ground, where there are
   any, reduce all velocities by the factor `decay` in each half of a step. */

EXPORT(go) void go(const scene *c, int steps, real decay)
{
    const integer count = c->sites * DIM;
    for (int k = 0; k < steps; k++) {
        EACH(count) c->v[i] *= decay;
        advance(c, 0, 1, 0);
        postprocess(c, 0, c->u, c->v);
        EACH(count) c->v[i] *= decay;
    }
}
