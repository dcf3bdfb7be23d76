/* Networks: contacts in any pattern.  Rows are the sites and one that stands still for the walls. */

#define AXES(q) for (int q = 0; q < DIM; q++)

static void place(const scene *c)
{
    const integer n = c->bonds;
    const real *restrict u = c->u, *restrict geometry = c->geometry;
    real *restrict r = c->r, *restrict along = c->along;
    for (integer i = 0; i < n; i++) AXES(q) along[q * n + i] = u[c->to[i] + q] - u[c->from[i] + q];
    for (integer s = 0; s < c->runs; s++) {
        const integer at = c->first[s], many = c->first[s + 1] - at;
#define PLACED(contact)                                                                     \
    EACH(many) {                                                                            \
        real D[DIM], w[DIM], e[DIM];                                                        \
        const real *here = geometry + at + i;                                               \
        AXES(q) D[q] = here[q * n], w[q] = along[q * n + at + i];                           \
        contact(D, w, here[DIM * n], here[(DIM + 1) * n], &r[at + i], e);                   \
        AXES(q) along[q * n + at + i] = e[q];                                               \
    }
        if (c->wall[s]) PLACED(wall_contact) else PLACED(pair_contact)
    }
}

static void gather(const scene *c)
{
    const integer n = c->bonds;
    const real *restrict f = c->f + 1, *restrict along = c->along;
    real *restrict pull = c->pull;
    EACH(c->entries) pull[i] = c->load[i];
    for (integer i = 0; i < n; i++)
        AXES(q) {
            const real part = f[i] * along[q * n + i];
            pull[c->from[i] + q] += part;
            pull[c->to[i] + q] -= part;
        }
}

/* A force pulls along the bond, which turns: rb n + T/(L + r) (1 - n n') of the derivatives by it. */
static void carry(const scene *c, real a, integer o)
{
    const integer n = c->bonds, apart = c->apart;
    const real *vb = c->vb + o * c->entries;
    real *wb = c->wb + o * c->entries;
    EACH(c->entries) {
        c->turn[i] = a * c->w[i] * vb[i];
        wb[i] += a * vb[i] * c->pull[i];
    }
    const real *restrict turn = c->turn, *restrict k = c->k, *restrict d = c->d;
    const real *restrict f = c->f + 1, *restrict r = c->r, *restrict along = c->along;
    const real *restrict length = c->geometry + (DIM + 1) * n;
    real *restrict ub = c->ub + o * c->entries, *restrict pb = c->pb + o * c->wanted * apart;
    real *restrict bent = c->bent, *restrict gb = c->gb + o * n;
    for (integer s = 0; s < c->runs; s++)
        for (integer i = c->first[s]; i < c->first[s + 1]; i++) {
            real y[DIM], t = 0;
            AXES(q) y[q] = turn[c->from[i] + q] - turn[c->to[i] + q];
            AXES(q) t += y[q] * along[q * n + i];
            const real across = c->wall[s] || DIM == 1 ? 0 : f[i] / (length[i] + r[i]);
            bent[i] = t;
            AXES(q) y[q] = t * k[i] * along[q * n + i] + across * (y[q] - t * along[q * n + i]);
            AXES(q) ub[c->to[i] + q] += y[q];
            AXES(q) ub[c->from[i] + q] -= y[q];
        }
    EACH(n) gb[i] += bent[i] * k[i];
    for (integer m = 0; m < c->wanted; m++)
        EACH(n) pb[m * apart + i] += bent[i] * d[m * apart + i];
}

/* The drift of a stage undone, and elongations before it. */
static void undrift(const scene *c, real b)
{
    EACH(c->room) c->u[i] -= b * c->v[i];
    place(c);
}

/* The kick of forces undone. */
static void unkick(const scene *c, real a)
{
    gather(c);
    EACH(c->room) c->v[i] -= a * c->w[i] * c->pull[i];
}
