/* A stage over a run of bonds of law number K of a chain.

   A stage is a kick v += a w (tension right - tension left) followed by a drift u += b v, done
   in one pass over the run, in blocks that stay in the nearest cache.  A law with roots or
   quotients is computed for several bonds in SIMD registers: `simd.c`.  Its first pass is part of
   the loop that updates the block before, so that the units for roots are not idle meanwhile. */

/* A bond with parameters of its own has a place for them and for its range, except in a batch whose
   chains have one spring each: there these repeat with each block.  Of other bonds each place of a
   block has a range. */
#define PLACE(j) (OWNED ? along * ((j) - start) : 0)
#if CHANGES
/* Where springs change, the rates of their energies follow the tensions, and are summed for each
   place of a block; their elongation range was computed before. */
#define NOTE_RANGE(q)
#define RATES(n) EACH(n) part[BLOCK - (n) + i] += f[BATCH + BLOCK + i];
#else
#define RATES(n)
#define NOTE_RANGE(q)                                                                             \
    low[(q) + i] = r[i] < low[(q) + i] ? r[i] : low[(q) + i];                               \
    high[(q) + i] = r[i] > high[(q) + i] ? r[i] : high[(q) + i];
#endif

#define ELONGATION(j)                                                                          \
    r[i] = u[(j) + i + BATCH] - u[(j) + i];                                                 \
    NOTE_RANGE(PLACE(j))

#define UPDATE(j)                                                                           \
    v[(j) + i] += a * w[(j) + i] * (f[i + BATCH] - f[i]);                                   \
    u[(j) + i] += b * v[(j) + i];

/* The same for a SIMD vector. */
#define ELONGATION_PACK(j)                                                                     \
    INTO(r + i) = INTO(u + (j) + i + BATCH) - INTO(u + (j) + i);                            \
    INTO(low + PLACE(j) + i) = smaller_of(INTO(r + i), INTO(low + PLACE(j) + i));           \
    INTO(high + PLACE(j) + i) = larger_of(INTO(r + i), INTO(high + PLACE(j) + i));

#define UPDATE_PACK(j)                                                                      \
    INTO(v + (j) + i) += a * INTO(w + (j) + i) * (INTO(f + i + BATCH) - INTO(f + i));       \
    INTO(u + (j) + i) += b * INTO(v + (j) + i);

#if IN_SIMD
/* The first pass for the pack with bond i of those from j on. */
#define FIRST(j)                                                                            \
    OF(first_tension_lanes)                                                                 \
    (i / WIDE, (const pack *)r, p, own + PLACE(j), places, (pack *)(f + BATCH), stored);
/* An incomplete last vector repeats a bond. */
#define FIRSTS(j, n)                                                                        \
    for (integer i = n; i % WIDE; i++) r[i] = r[(n) - 1];                                   \
    for (integer i = 0; i < (n); i += WIDE) { FIRST(j) }
#else
#define FIRSTS(j, n)
#endif

/* Tensions of n bonds from bond q of the run on.  A long law is compiled once, not inlined. */
#if IS_LONG
__attribute__((noinline, flatten)) static
#else
static inline
#endif
void OF(tensions)(integer n, integer q, real *restrict r, const real *restrict shared,
                  const real *restrict own, integer all, real *restrict f, pack (*stored)[ROOM])
{
#if IN_SIMD
    n = (n + WIDE - 1) / WIDE;
    OF(rest_tension_lanes)(n, (const pack *)r, shared, own + q, all, (pack *)f, stored);
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

#define CARRY(n) for (int l = 0; l < BATCH; l++) f[l] = f[(n) + l];
#define PULL(j, n)                                                                          \
    OF(tensions)(n, PLACE(j), r, p, own, places, f + BATCH, stored);                          \
    RATES(n)

__attribute__((flatten)) static void OF(stage)(
    const scene *c, integer s, real a, real b, integer active, real *left)
{
    __attribute__((aligned(64))) real r[BLOCK], room[(1 + CHANGES) * BLOCK + BATCH + WIDE];
    real part[BLOCK] = {0};
    pack stored[WAITING][ROOM];
    real *const f = room + (WIDE - BATCH % WIDE) % WIDE; /* aligns the tensions of a block */
    real *restrict u = c->u, *restrict v = c->v;
    const real *restrict w = c->w;
    const integer start = BATCH * c->first[s], all = BATCH * c->first[s + 1] - start;
    const integer odd = all % BLOCK, most = active - start - odd; /* whole blocks after `odd` */
    const integer last = start + (most < all - odd ? odd + (most + BLOCK - 1) / BLOCK * BLOCK : all);
    const real *restrict shared = c->shared + s * PARAMETERS, *restrict own = c->own + c->own_at[s];
    const integer places = c->range_at[s + 1] - c->range_at[s], along = places == all;
    real *restrict low = c->low + c->range_at[s], *restrict high = c->high + c->range_at[s];
    real p[PARAMETERS + 1]; /* a copy, which the compiler may assume to exist and not to alias */
    for (int i = 0; i < PARAMETERS; i++) p[i] = shared[i];
    integer j = start;
    for (int l = 0; l < BATCH; l++) f[l] = left[l];
    if (odd) {
        EACH(odd) { ELONGATION(j) }
        FIRSTS(j, odd)
        PULL(j, odd)
        EACH(odd) { UPDATE(j) }
        CARRY(odd)
        j += odd;
    }
    if (j < last) {
        EACH(BLOCK) { ELONGATION(j) }
        FIRSTS(j, BLOCK)
        for (; j + BLOCK < last; j += BLOCK) {
            PULL(j, BLOCK)
#if IN_SIMD && !CHANGES
            for (integer i = 0; i < BLOCK; i += WIDE) {
                ELONGATION_PACK(j + BLOCK)
                UPDATE_PACK(j)
                FIRST(j + BLOCK)
            }
            CARRY(BLOCK)
#else
            EACH(BLOCK) { ELONGATION(j + BLOCK) UPDATE(j) }
            CARRY(BLOCK)
            FIRSTS(j + BLOCK, BLOCK)
#endif
        }
        PULL(j, BLOCK)
        EACH(BLOCK) { UPDATE(j) }
        CARRY(BLOCK)
    }
    for (int l = 0; l < BATCH; l++) left[l] = f[l];
#if CHANGES
    for (int i = 0; i < BLOCK; i++) left[BATCH] += part[(BLOCK - odd + i) % BLOCK];
#endif
}

#undef PLACE
#undef NOTE_RANGE
#undef RATES
#undef ELONGATION
#undef UPDATE
#undef ELONGATION_PACK
#undef UPDATE_PACK
#undef FIRST
#undef FIRSTS
#undef CARRY
#undef PULL
