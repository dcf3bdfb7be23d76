/* A stage over a run of bonds of law number K of a chain.

   A stage is a kick v += a w (tension right - tension left) followed by a drift u += b v, done
   in one pass over the run in blocks that stay in the nearest cache.  A law with roots or quotients
   is computed for several bonds side by side: `simd.c`. */

/* A bond with parameters of its own has a range too; of others each place of a block. */
#define PLACE(q) (OWNED ? (q) : i)
#if CHANGES
/* Where springs change, rates of their energies come in packs behind tensions, and are summed for
   each place of a block; how far springs come was looked at before. */
#define SEEN(q)
#define RATES(n) EACH(n) part[BLOCK - (n) + i] += f[LANES + ((n) + WIDE - 1) / WIDE * WIDE + i];
#else
#define RATES(n)
#define SEEN(q)                                                                             \
    low[PLACE(q)] = r[i] < low[PLACE(q)] ? r[i] : low[PLACE(q)];                            \
    high[PLACE(q)] = r[i] > high[PLACE(q)] ? r[i] : high[PLACE(q)];
#endif

#define STRETCH(j)                                                                          \
    r[i] = u[(j) + i + LANES] - u[(j) + i];                                                 \
    SEEN((j) - start + i)

#define UPDATE(j)                                                                           \
    v[(j) + i] += a * w[(j) + i] * (f[i + LANES] - f[i]);                                   \
    u[(j) + i] += b * v[(j) + i];

/* Tensions of n bonds from bond q of the run on; a last pack that is not full repeats a bond.  A
   long law is compiled once only, apart from where it is called. */
#if IS_LONG
__attribute__((noinline, flatten)) static
#else
static inline
#endif
void OF(tensions)(integer n, integer q, real *restrict r, const real *restrict shared,
                  const real *restrict own, integer all, real *restrict f)
{
#if BESIDE
    for (integer i = n; i % WIDE; i++) r[i] = r[n - 1];
    OF(tension_lanes)((n + WIDE - 1) / WIDE, (const pack *)r, shared, own + q, all, (pack *)f);
#elif OWNED
    EACH(n) {
        real p[PARAMETERS + 1];
        LAW(take)(p, shared, own, all, q + i);
        f[i] = LAW(tension)(r[i], p);
    }
#else
    EACH(n) f[i] = LAW(tension)(r[i], shared);
#endif
}

#define CARRY(n) for (int l = 0; l < LANES; l++) f[l] = f[(n) + l];
#define PULL(j, n)                                                                          \
    OF(tensions)(n, (j) - start, r, p, own, all, f + LANES);                                \
    RATES(n)

__attribute__((flatten)) static void OF(stage)(
    const scene *c, integer s, real a, real b, real *left)
{
    __attribute__((aligned(64))) real r[BLOCK], room[(1 + CHANGES) * BLOCK + LANES + WIDE];
    real part[BLOCK] = {0};
    real *const f = room + (WIDE - LANES % WIDE) % WIDE; /* tensions of a block begin with a pack */
    real *restrict u = c->u, *restrict v = c->v;
    const real *restrict w = c->w;
    const integer start = LANES * c->first[s], last = LANES * c->first[s + 1];
    const integer all = last - start;
    const real *restrict shared = c->shared + s * PARAMETERS, *restrict own = c->own + c->own_at[s];
    real *restrict low = c->low + c->met_at[s], *restrict high = c->high + c->met_at[s];
    real p[PARAMETERS + 1]; /* which is there: the compiler need not look whether it is */
    for (int i = 0; i < PARAMETERS; i++) p[i] = shared[i];
    integer j = start;
    for (int l = 0; l < LANES; l++) f[l] = left[l];
    integer odd = all % BLOCK;
    if (odd) {
        EACH(odd) { STRETCH(j) }
        PULL(j, odd)
        EACH(odd) { UPDATE(j) }
        CARRY(odd)
        j += odd;
    }
    if (j < last) {
        EACH(BLOCK) { STRETCH(j) }
        for (; j + BLOCK < last; j += BLOCK) {
            PULL(j, BLOCK)
            EACH(BLOCK) { STRETCH(j + BLOCK) UPDATE(j) }
            CARRY(BLOCK)
        }
        PULL(j, BLOCK)
        EACH(BLOCK) { UPDATE(j) }
        CARRY(BLOCK)
    }
    for (int l = 0; l < LANES; l++) left[l] = f[l];
#if CHANGES
    for (int i = 0; i < BLOCK; i++) left[LANES] += part[(BLOCK - odd + i) % BLOCK];
#endif
}

#undef PLACE
#undef SEEN
#undef RATES
#undef STRETCH
#undef UPDATE
#undef CARRY
#undef PULL
