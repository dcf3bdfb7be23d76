/* Whole steps of a network, behind the text of its loop.  Dashpots to the ground, where there are
   any, leave a share `kept` of all velocities in each half of a step. */

EXPORT(go) void go(const scene *c, int steps, real kept)
{
    const integer count = c->sites * DIM;
    for (int k = 0; k < steps; k++) {
        EACH(count) c->v[i] *= kept;
        advance(c, 0, 1, 0);
        postprocess(c, 0, c->u, c->v);
        EACH(count) c->v[i] *= kept;
    }
}
