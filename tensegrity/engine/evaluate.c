/* Derivatives of law number 0 outside of a loop; EVALUATIONS(X) lists X(order, name), and IN_PACKS
   says whether its energy is computed in SIMD registers. */

#define ALL_PARAMETERS(value)                                                               \
    real p[PARAMETERS + 1];                                                                 \
    for (int k = 0; k < PARAMETERS; k++) p[k] = value;

/* The order-th derivative of the energy at `rows` times n elongations; parameters (PARAMETERS), or
   each of the n has its own, (PARAMETERS, n). */
#define EVALUATE(ORDER, NAME)                                                               \
    if (order == ORDER && !own) {                                                           \
        ALL_PARAMETERS(parameters[k])                                                       \
        EACH(rows * n) out[i] = NAME##_0(r[i], p);                                          \
    }                                                                                       \
    if (order == ORDER && own)                                                              \
        for (integer row = 0; row < rows; row++, r += n, out += n)                          \
            EACH(n) {                                                                       \
                ALL_PARAMETERS(parameters[k * n + i])                                       \
                out[i] = NAME##_0(r[i], p);                                                 \
            }

void evaluate(integer order, integer own, integer rows, integer n, const real *restrict parameters,
              const real *restrict r, real *restrict out)
{
    EVALUATIONS(EVALUATE)
}

#if WIDE == 8 && IN_PACKS
#define PACKS 8 /* vectors of bonds whose energies are computed together */
static void in_packs(integer n, const real *restrict p, const real *restrict r,
                     real *restrict out)
{
    for (integer start = 0; start < n; start += PACKS * WIDE) {
        const integer left = n - start, some = left < PACKS * WIDE ? left : PACKS * WIDE;
        real room[PACKS * WIDE];
        pack x[PACKS], y[PACKS];
        EACH(some) room[i] = r[start + i];
        for (integer i = some; i % WIDE; i++) room[i] = r[start];
        const integer packs = (some + WIDE - 1) / WIDE;
        EACH(packs) x[i] = load(room + i * WIDE);
        energy_lanes_0(packs, x, p, y);
        EACH(packs) store(room + i * WIDE, y[i]);
        EACH(some) out[start + i] = room[i];
    }
}
#endif

/* Energy (order 0), tension or stiffness at n elongations, vectorised as the law is inlined.  The
   function above is not, as fitted laws depend on the last bit of its results. */
#define VALUE(ORDER, NAME)                                                                  \
    if (order == ORDER && ORDER < 3) EACH(n) out[i] = NAME##_0(r[i], p);

__attribute__((flatten)) void values(integer order, integer n, const real *restrict parameters,
                                     const real *restrict r, real *restrict out)
{
    ALL_PARAMETERS(parameters[k])
#if WIDE == 8 && IN_PACKS
    if (order == 0) {
        in_packs(n, p, r, out);
        return;
    }
#endif
    EVALUATIONS(VALUE)
}

/* The energies alone, where each of the n has parameters of its own. */
#define ENERGY_OWN(ORDER, NAME)                                                             \
    if (order == ORDER && ORDER == 0)                                                       \
        EACH(n) {                                                                           \
            ALL_PARAMETERS(parameters[k * n + i])                                           \
            out[i] = NAME##_0(r[i], p);                                                     \
        }

__attribute__((flatten)) void values_own(integer order, integer n, const real *restrict parameters,
                                         const real *restrict r, real *restrict out)
{
    EVALUATIONS(ENERGY_OWN)
}
