/* Chains: bond j joins sites j and j + 1. */

static void place(const scene *c)
{
    const real *restrict u = c->u;
    real *restrict r = c->r;
    EACH(c->bonds) r[i] = u[i + 1] - u[i];
}

/* Forces on the sites from tensions; f[0] and f[bonds + 1] are 0. */
static void gather(const scene *c)
{
    const real *restrict f = c->f;
    real *restrict pull = c->pull;
    EACH(c->entries) pull[i] = f[i + 1] - f[i];
}

/* From the derivatives by the forces on the sites, `turn`, to those by u and the parameters. */
static void scatter(const scene *c, integer o)
{
    const integer n = c->bonds;
    const real *restrict turn = c->turn, *restrict k = c->k, *restrict d = c->d;
    real *restrict ub = c->ub + o * c->entries, *restrict pb = c->pb + o * c->wanted * n;
    real *restrict bent = c->bent, *restrict back = c->back;
    EACH(n) {
        bent[i] = turn[i] - turn[i + 1];
        back[i + 1] = bent[i] * k[i];
    }
    for (integer m = 0; m < c->wanted; m++) EACH(n) pb[m * n + i] += bent[i] * d[m * n + i];
    EACH(c->entries) ub[i] += back[i] - back[i + 1];
}
