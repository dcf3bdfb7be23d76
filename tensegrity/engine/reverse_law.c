/* Of bonds of law number K: tension, stiffness, and derivatives of the tension by what is wanted. */

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
