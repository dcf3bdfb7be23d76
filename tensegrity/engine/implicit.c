/* Steps of the implicit midpoint rule, one text for every scene.

   Included after `steps.c`, of which it takes acceleration(scene, u, a, n).  With h = dt/2 a step
   solves d = h v + h^2 w F(u + d) for the displacements d to its middle by Newton's method; then
   u += 2 d and v += 2/h (d - h v).  Divided by sqrt(w) the tangent is symmetric: the matrix
   1 + h^2 sqrt(w) K sqrt(w), in whose rows and columns of held sites, w = 0, there is but the 1. */

#define HALVINGS 30   /* of an update that leads out of the domain of a law */
#define CLOSE 1e-6    /* updates below this, relative, converge quadratically */

typedef struct {
    const real *geometry;             /* (DIM + 2, bonds) D, g, L */
    const real *parameters;           /* (bonds, PARAMETERS) */
    const real *load;                 /* (entries) constant forces */
    const real *dt;
    real *straight, *moved, *update;  /* scratch: (entries) h v, d, and its last change */
    real *root, *force, *right;       /* (entries) sqrt(w), F, and -residuals in the band's order */
    real *place, *slope;              /* (count) displacements at the middle, accelerations */
    real *band;                       /* (entries, width + 1) columns, each from its diagonal on */
    real *travel;                     /* bound on how far any entry moved */
    const integer *law, *from, *to;   /* (bonds) law, and where the rows of a bond begin; a wall's,
                                         `from`, is behind all entries */
    const integer *at;                /* (entries) where each is in the band */
    integer bonds, entries, count, width, iterations; /* count: of u, walls' rows included */
} implicit;

#ifndef DIM /* a line: D = 1, g = 0 */
#define DIM 1
#define AXES(k) for (int k = 0; k < DIM; k++)
#define pair_contact wall_contact
static inline void wall_contact(const real *d, const real *w, real g, real length, real *r,
                                real *along)
{
    *r = g + *d * *w, *along = *d;
}
#endif

/* Add h^2 times a stiffness between two entries to the matrix. */
static inline void couple(const implicit *m, integer i, integer j, real stiffness)
{
    const integer row = m->at[i], column = m->at[j];
    if (row >= column && m->root[i] && m->root[j])
        m->band[column * m->width + row] += m->root[i] * m->root[j] * stiffness;
}

/* Forces, matrix and residuals at u + d with the last update; returns whether these are finite. */
static int linearised(const scene *c, const implicit *m)
{
    const integer n = m->entries, bonds = m->bonds;
    const real h = *m->dt / 2, *place = m->place;
    EACH(n) m->place[i] = c->u[i] + (m->moved[i] + m->update[i]);
    EACH(n) m->force[i] = m->load[i];
    EACH(n * (m->width + 1)) m->band[i] = 0;
    EACH(n) m->band[m->at[i] * (m->width + 1)] = 1;
    for (integer b = 0; b < bonds; b++) {
        const integer ends[2] = {m->from[b], m->to[b]}, wall = ends[0] >= n;
        const real length = m->geometry[(DIM + 1) * bonds + b], *p = m->parameters + b * PARAMETERS;
        real separation[DIM], moved[DIM], along[DIM], r, tension = 0, stiffness = 0;
        AXES(k) {
            separation[k] = m->geometry[k * bonds + b];
            moved[k] = place[ends[1] + k] - (wall ? 0 : place[ends[0] + k]);
        }
#ifdef ENDS
        real slope[2 * DIM], second[4 * DIM * DIM];
        pair_of_ends(place + ends[0], place + ends[1], p, &r, slope);
        tangent_of_ends(place + ends[0], place + ends[1], p, second);
#define FORCE(e, k) -slope[e * DIM + k]
#define TANGENT(e, k, o, l) second[(o * DIM + l) * 2 * DIM + e * DIM + k]
#else
        (wall ? wall_contact : pair_contact)(
            separation, moved, m->geometry[DIM * bonds + b], length, &r, along);
        switch (m->law[b]) {
#define LAW_CASE(K)                                                                         \
    case K: tension = tension_##K(r, p), stiffness = stiffness_##K(r, p); break;
            LAWS(LAW_CASE)
        }
        const real across = DIM > 1 && !wall ? tension / (length + r) : 0; /* it turns */
#define FORCE(e, k) (e ? -tension * along[k] : tension * along[k])
#define TANGENT(e, k, o, l)                                                                 \
    (e == o ? 1 : -1) *                                                                     \
        ((stiffness - across) * along[k] * along[l] + (k == l ? across : 0))
#endif
        for (integer e = wall; e < 2; e++)
            AXES(k) {
                m->force[ends[e] + k] += FORCE(e, k);
                for (integer o = wall; o < 2; o++)
                    AXES(l) couple(m, ends[e] + k, ends[o] + l, h * h * (TANGENT(e, k, o, l)));
            }
    }
    int is_valid = 1;
    for (integer i = 0; i < n; i++) {
        const real off = m->moved[i] + m->update[i] - m->straight[i] - h * h * c->w[i] * m->force[i];
        m->right[m->at[i]] = -off / (m->root[i] ? m->root[i] : 1);
        is_valid &= isfinite(off) != 0;
    }
    return is_valid;
}

/* Solve by the factorisation L D L': overwrites `right` by the solution and the matrix by L D. */
static void solve(const implicit *m)
{
    const integer n = m->entries, width = m->width;
    real *restrict right = m->right;
    for (integer j = 0; j < n; j++) {
        const real *restrict own = m->band + j * width; /* own[i]: row i of column j */
        const integer last = j + width < n ? j + width : n - 1;
        for (integer k = j + 1; k <= last; k++) {
            const real part = own[k] / own[j];
            real *restrict column = m->band + k * width;
            if (part != 0) EACH(last - k + 1) column[k + i] -= part * own[k + i];
            right[k] -= part * right[j];
        }
    }
    for (integer j = n - 1; j >= 0; j--) {
        const real *own = m->band + j * width;
        for (integer k = j + 1; k <= j + width && k < n; k++) right[j] -= own[k] * right[k];
        right[j] /= own[j];
    }
}

/* Displacements to the middle of a step, to round-off; returns whether Newton's method
   converged. */
static int solved(const scene *c, const implicit *m)
{
    const integer n = m->entries;
    const real epsilon = nextafter((real)1, (real)2) - 1, h = *m->dt / 2;
    real last = INFINITY;
    EACH(n) m->straight[i] = m->update[i] = h * c->v[i], m->moved[i] = 0;
    for (integer k = 0; k <= m->iterations; k++) {
        for (integer halved = 0; !linearised(c, m); halved++) {
            if (halved == HALVINGS) return 0;
            EACH(n) m->update[i] /= 2;
        }
        real size = 0, scale = 0;
        for (integer i = 0; i < n; i++) {
            m->moved[i] += m->update[i];
            size = larger(size, fabs(m->update[i]));
            scale = larger(scale, larger(fabs(c->u[i]), fabs(m->moved[i])));
        }
        if (k && (size <= epsilon * scale || (size < CLOSE * scale && size >= last / 2))) return 1;
        if (k) last = size;
        solve(m);
        EACH(n) m->update[i] = (m->root[i] ? m->root[i] : 1) * m->right[m->at[i]];
    }
    return 0;
}

/* Whole steps; 1 where the equations of one were not solved. */
integer advance_implicit(const scene *c, const implicit *m, integer steps, integer opened)
{
    FLUSH
    const integer n = m->entries;
    const real dt = *m->dt;
    EACH(n) m->root[i] = sqrt(c->w[i]);
    for (integer k = 0; k < steps; k++) {
        if (!solved(c, m)) return 1;
        acceleration(c, m->place, m->slope, m->count); /* of walls; also notes elongations */
        real largest = 0;
        for (integer i = 0; i < n; i++) {
            largest = larger(largest, fabs(2 * m->moved[i]));
            c->v[i] += 4 / dt * (m->moved[i] - m->straight[i]);
            c->u[i] += 2 * m->moved[i];
        }
        *m->travel += largest;
        for (integer i = n; i < m->count; i++) c->v[i] += dt * m->slope[i];
        acceleration(c, c->u, m->slope, m->count); /* notes those at the end of the step */
    }
    return 0;
}
