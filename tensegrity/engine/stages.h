/* The kick of stage i of a step: the first includes the closing kick of the step before, where it
   comes `after` one. */
static inline real kick(const scene *c, integer i, integer after)
{
    return c->kicks[i] + (after && i == 0 && c->closing ? c->kicks[c->stages] : 0);
}
