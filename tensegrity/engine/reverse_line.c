/* Chains: bond j joins sites j and j + 1.  Loops go on to `room`, a whole number of packs beyond
   the last site, where nothing weighs and nothing pulls. */

#if EXACT
static void place(const scene *c)
{
    const real *restrict u = c->u;
    real *restrict r = c->r;
    EACH(c->room) r[i] = u[i + 1] - u[i];
}

static void gather(const scene *c)
{
    const real *restrict f = c->f;
    real *restrict pull = c->pull;
    EACH(c->room) pull[i] = f[i + 1] - f[i];
}
#endif

/* From the derivatives by the velocities to those by masses, parameters and u. */
static void carry(const scene *c, real a, integer o)
{
    const integer apart = c->apart;
    const real *restrict w = c->w, *restrict pull = c->pull, *restrict vb = c->vb + o * c->entries;
    const real *restrict k = c->k, *restrict d = c->d;
    real *restrict ub = c->ub + o * c->entries, *restrict wb = c->wb + o * c->entries;
    real *restrict pb = c->pb + o * c->wanted * apart;
    real *restrict bent = c->bent, *restrict back = c->back;
    EACH(c->room) {
        bent[i] = a * (w[i] * vb[i] - w[i + 1] * vb[i + 1]);
        back[i + 1] = bent[i] * k[i];
    }
    EACH(c->room) wb[i] += a * vb[i] * pull[i];
    for (integer m = 0; m < c->wanted; m++)
        EACH(c->room) pb[m * apart + i] += bent[i] * d[m * apart + i];
    EACH(c->room) ub[i] += back[i] - back[i + 1];
}

/* The drift of a stage undone, and elongations before it. */
static void undrift(const scene *c, real b)
{
    real *restrict r = c->r, *restrict u = c->u;
    const real *restrict v = c->v;
    EACH(c->room) {
        const real here = u[i] - b * v[i];
        r[i] = u[i + 1] - b * v[i + 1] - here;
        u[i] = here;
    }
}

/* Forces on the sites from tensions, and their kick undone; f[0] is 0. */
static void unkick(const scene *c, real a)
{
    const real *restrict f = c->f, *restrict w = c->w;
    real *restrict pull = c->pull, *restrict v = c->v;
    EACH(c->room) {
        pull[i] = f[i + 1] - f[i];
        v[i] -= a * w[i] * pull[i];
    }
}
