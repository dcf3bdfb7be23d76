/* Forces of a run of contacts of law number K, of pairs or with walls. */

/* Tensions of a group of contacts at the elongations r: parameters shared, or some of their own.
   A long law is kept in one function, so that it is compiled once only. */
#if IS_LONG
__attribute__((noinline, flatten)) static void OF(tensions)(
#else
__attribute__((always_inline, flatten)) static inline void OF(tensions)(
#endif
    const real *restrict shared, const real *restrict own, integer all, const real *restrict r,
    real *restrict t)
{
    WHOLE_GROUP {
        real p[PARAMETERS + 1];
#if OWNED
        LAW(take)(p, shared, own, all, i);
#else
        for (int k = 0; k < PARAMETERS; k++) p[k] = shared[k];
#endif
        t[i] = LAW(tail)(r[i], LAW(head)(r[i], p), p);
    }
}

__attribute__((always_inline)) static inline void OF(run)(
    const scene *c, integer s, const real *restrict u, const int wall)
{
    const integer n = c->contacts, start = c->first[s], last = c->first[s + 1];
    const real *restrict shared = c->shared + s * PARAMETERS, *restrict own = c->own + c->own_at[s];
    real *restrict low = c->low, *restrict high = c->high, *restrict force = c->force;
    const real *restrict geometry = c->geometry;
    for (integer b = start; b < last; b += GROUP) {
        real x[DIM][GROUP], along[DIM][GROUP], r[GROUP], t[GROUP];
        const integer *restrict from = c->from + b, *restrict to = c->to + b;
        for (int i = 0; i < GROUP; i++)
            AXES(k) x[k][i] = wall ? u[to[i] + k] : u[to[i] + k] - u[from[i] + k];
        EACH(GROUP) {
            real d[DIM], w[DIM], e[DIM];
            const real gap = geometry[DIM * n + b + i], length = geometry[(DIM + 1) * n + b + i];
            AXES(k) d[k] = geometry[k * n + b + i], w[k] = x[k][i];
            if (wall) wall_contact(d, w, gap, length, &r[i], e);
            else pair_contact(d, w, gap, length, &r[i], e);
            AXES(k) along[k][i] = e[k];
            low[b + i] = r[i] < low[b + i] ? r[i] : low[b + i];
            high[b + i] = r[i] > high[b + i] ? r[i] : high[b + i];
        }
        OF(tensions)(shared, own + (b - start), last - start, r, t);
        AXES(k) EACH(GROUP) along[k][i] *= t[i];
        ROUNDED(along)
        for (int i = 0; i < GROUP; i++)
            AXES(k) {
                force[from[i] + k] += along[k][i];
                force[to[i] + k] -= along[k][i];
            }
    }
}

__attribute__((flatten)) static void OF(pairs)(const scene *c, integer s, const real *u)
{
    OF(run)(c, s, u, 0);
}

__attribute__((flatten)) static void OF(walls)(const scene *c, integer s, const real *u)
{
    OF(run)(c, s, u, 1);
}
