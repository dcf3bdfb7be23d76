/* Steps of every method, one text for every scene.

   Included after a loop that defines `scene` and stage(scene, a, b): a kick by a, a drift by b. */

/* Every method has a function that advances a scene by whole steps, and one that turns copies of u
   and v into the output state; both return whether they had to stop, which only some methods do.

   The closing kick of a step of a splitting is merged with the first kick of the next one: steps
   lack their closing kick, and begin with that of the step before if they are `opened`. */
#ifndef NARROW
#define NARROW(c)
#endif
#ifndef ALL_MAY_MOVE
#define ALL_MAY_MOVE(c)
#endif

#ifndef STEPPER
integer advance(const scene *c, const void *none, integer steps, integer opened)
{
    FLUSH
    for (integer k = 0; k < steps; k++) {
        for (integer i = 0; i < c->stages; i++)
            stage(c, KICK(c, i, k > 0 || opened), c->drifts[i]);
        NARROW(c)
    }
    return 0;
}

integer postprocess(const scene *c, const void *none, real *u, real *v)
{
    FLUSH
    scene copy = *c;
    copy.u = u, copy.v = v;
    ALL_MAY_MOVE(copy)
    if (c->closing) stage(&copy, c->kicks[c->stages], 0);
    return 0;
}
#endif

/* Accelerations at u, of n entries: the velocities after a kick by 1 from rest. */
static void acceleration(const scene *c, real *u, real *a, integer n)
{
    scene still = *c;
    still.u = u, still.v = a;
    ALL_MAY_MOVE(still)
    EACH(n) a[i] = 0;
    stage(&still, 1, 0);
}
