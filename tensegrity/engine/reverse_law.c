/* Of bonds of law number K: tension, stiffness, and derivatives of the tension by what is wanted. */

#if BESIDE
/* In packs; the last writes up to a pack behind the n bonds. */
static void OF(rows)(
    integer n, integer apart, const real *r, real *f, real *k, real *d, const real *shared,
    const real *own)
{
    for (integer j = 0; j < n; j += GROUP * ROOM) {
        const integer left = n - j < GROUP * ROOM ? n - j : GROUP * ROOM;
        OF(reverse_lanes)((left + GROUP - 1) / GROUP, apart, r + j, f + j, k + j, d + j, shared,
                          own + j, n);
    }
}
#else
__attribute__((noinline, flatten)) static void OF(rows)(
    integer n, integer apart, const real *restrict r, real *restrict f, real *restrict k,
    real *restrict d, const real *restrict shared, const real *restrict own)
{
#if !OWNED
    real p[PARAMETERS + 1];
    for (int m = 0; m < PARAMETERS; m++) p[m] = shared[m];
#endif
    EACH(n) {
#if OWNED
        real p[PARAMETERS + 1];
        LAW(take)(p, shared, own, n, i);
#endif
        real y[2 + WANTED];
        LAW(reverse)(r[i], p, y);
        f[i] = y[0];
        k[i] = y[1];
        for (int m = 0; m < WANTED; m++) d[m * apart + i] = y[2 + m];
    }
}
#endif

#if EXACT /* one text of the tension for both directions */
__attribute__((noinline, flatten)) static void OF(pull)(
    integer n, const real *restrict r, real *restrict f, const real *restrict shared,
    const real *restrict own)
{
#if !OWNED
    real p[PARAMETERS + 1];
    for (int m = 0; m < PARAMETERS; m++) p[m] = shared[m];
#endif
    EACH(n) {
#if OWNED
        real p[PARAMETERS + 1];
        LAW(take)(p, shared, own, n, i);
#endif
        f[i] = LAW(tension)(r[i], p);
    }
}
#endif
