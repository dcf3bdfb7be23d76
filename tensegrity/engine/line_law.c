/* A stage over a run of bonds of law number K of a chain.

   A stage is a kick v += a w (tension right - tension left) followed by a drift u += b v, done
   in one pass over the run in blocks that stay in the nearest cache.  The innermost square root
   of a law (head) is computed in the loop that updates the block before, apart from the rest
   (tail): what limits a processor here is the longest chain of slow operations that fits its
   window, not their number alone.  A law with roots or quotients whose processor has estimates
   to start them from is computed for several bonds side by side instead: `simd.c`. */

#if OWNED
#define P(q) real p[PARAMETERS + 1]; LAW(take)(p, shared, own, all, q);
#define PLACE(q) (q)
#else
/* Each place of a block has a range. */
#define P(q)
#define PLACE(q) i
#endif
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

#if BESIDE
#define HEAD(j)                                                                             \
    r[i] = u[(j) + i + LANES] - u[(j) + i];                                                 \
    SEEN((j) - start + i)
#else
#define HEAD(j)                                                                             \
    P((j) - start + i)                                                                      \
    r[i] = u[(j) + i + LANES] - u[(j) + i];                                                 \
    SEEN((j) - start + i)                                                                   \
    h[i] = LAW(head)(r[i], p);
#endif

#define UPDATE(j)                                                                           \
    v[(j) + i] += a * w[(j) + i] * (f[i + LANES] - f[i]);                                   \
    u[(j) + i] += b * v[(j) + i];

#if BESIDE
/* Tensions of n bonds from bond q of the run on; a last pack that is not full repeats a bond. */
static inline void OF(beside)(integer n, integer q, real *r, const real *shared, const real *own,
                              integer all, real *f)
{
    for (integer i = n; i % WIDE; i++) r[i] = r[n - 1];
    OF(tension_lanes)((n + WIDE - 1) / WIDE, (const pack *)r, shared, own + q, all, (pack *)f);
}
#define TAILS(j, n)                                                                         \
    OF(beside)(n, (j) - start, r, shared, own, all, f + LANES);                             \
    RATES(n)
#elif IS_LONG
/* A long law is kept in a function of its own, so that it is compiled once only. */
__attribute__((noinline, flatten)) static void OF(row)(
    integer n, const real *restrict r, const real *restrict h, real *restrict f,
    const real *shared, const real *own, integer all)
{
#if OWNED
    EACH(n) { P(i) f[i] = LAW(tail)(r[i], h[i], p); }
#else
    EACH(n) f[i] = LAW(tail)(r[i], h[i], shared);
#endif
}
#if OWNED
#define TAILS(j, n) OF(row)(n, r, h, f + LANES, shared, own + ((j) - start), all);
#else
#define TAILS(j, n) OF(row)(n, r, h, f + LANES, p, own, all);
#endif
#else
#define TAILS(j, n) EACH(n) { P((j) - start + i) f[i + LANES] = LAW(tail)(r[i], h[i], p); }
#endif

__attribute__((flatten)) static void OF(stage)(
    const scene *c, integer s, real a, real b, real *left)
{
    SIDE real r[BLOCK], h[BLOCK], room[(1 + CHANGES) * BLOCK + LANES + WIDE];
    real *const f = room + BEFORE, part[BLOCK] = {0};
    real *restrict u = c->u, *restrict v = c->v;
    const real *restrict w = c->w;
    const integer start = LANES * c->first[s], last = LANES * c->first[s + 1];
    const integer all = last - start;
    const real *restrict shared = c->shared + s * PARAMETERS, *restrict own = c->own + c->own_at[s];
    real *restrict low = c->low + c->met_at[s], *restrict high = c->high + c->met_at[s];
    integer j = start;
#if !OWNED
    real p[PARAMETERS + 1];
    for (int i = 0; i < PARAMETERS; i++) p[i] = shared[i];
#endif
    for (int l = 0; l < LANES; l++) f[l] = left[l];
    integer odd = all % BLOCK;
    if (odd) {
        EACH(odd) { HEAD(j) }
        TAILS(j, odd)
        EACH(odd) { UPDATE(j) }
        CARRY(odd)
        j += odd;
    }
    if (j < last) {
        EACH(BLOCK) { HEAD(j) }
        for (; j + BLOCK < last; j += BLOCK) {
            TAILS(j, BLOCK)
            EACH(BLOCK) { HEAD(j + BLOCK) UPDATE(j) }
            CARRY(BLOCK)
        }
        TAILS(j, BLOCK)
        EACH(BLOCK) { UPDATE(j) }
        CARRY(BLOCK)
    }
    for (int l = 0; l < LANES; l++) left[l] = f[l];
#if CHANGES
    for (int i = 0; i < BLOCK; i++) left[LANES] += part[(BLOCK - odd + i) % BLOCK];
#endif
}

#undef P
#undef SEEN
#undef RATES
#undef PLACE
#undef HEAD
#undef UPDATE
#undef TAILS
