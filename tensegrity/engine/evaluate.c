/* Derivatives of the laws, outside of a loop; EVALUATIONS(X) lists X(K, order, name), ENERGIES(X)
   the laws whose energies are compiled, X(K, whether packs of numbers gain by it). */

#define ALL_PARAMETERS(value)                                                               \
    real p[PARAMETERS + 1];                                                                 \
    for (int k = 0; k < PARAMETERS; k++) p[k] = value;

#define EVALUATE(K, ORDER, NAME)                                                            \
    if (law == K && order == ORDER) {                                                       \
        ALL_PARAMETERS(parameters[k])                                                       \
        EACH(n) out[i] = NAME##_##K(r[i], p);                                               \
    }

/* The order-th derivative of one law's energy at n elongations. */
void evaluate(integer law, integer order, integer n, const real *restrict parameters,
              const real *restrict r, real *restrict out)
{
    EVALUATIONS(EVALUATE)
}

#define EVALUATE_OWN(K, ORDER, NAME)                                                        \
    if (law == K && order == ORDER)                                                         \
        for (integer row = 0; row < rows; row++, r += n, out += n)                          \
            EACH(n) {                                                                       \
                ALL_PARAMETERS(parameters[k * n + i])                                       \
                out[i] = NAME##_##K(r[i], p);                                               \
            }

/* The same for `rows` times n elongations, where each of the n has parameters of its own,
   (PARAMETERS, n). */
void evaluate_own(integer law, integer order, integer rows, integer n,
                  const real *restrict parameters, const real *restrict r, real *restrict out)
{
    EVALUATIONS(EVALUATE_OWN)
}

#define PACKS 8 /* of bonds whose energies are found side by side */
#define ENERGY_0(K) EACH(n) out[i] = energy_##K(r[i], p);
#if WIDE == 8
#define ENERGY_1(K)                                                                         \
    for (integer start = 0; start < n; start += PACKS * WIDE) {                             \
        const integer left = n - start, some = left < PACKS * WIDE ? left : PACKS * WIDE;   \
        real room[PACKS * WIDE];                                                            \
        pack x[PACKS], y[PACKS];                                                            \
        EACH(some) room[i] = r[start + i];                                                  \
        for (integer i = some; i % WIDE; i++) room[i] = r[start];                           \
        const integer packs = (some + WIDE - 1) / WIDE;                                     \
        EACH(packs) x[i] = load(room + i * WIDE);                                           \
        energy_lanes_##K(packs, x, p, y);                                                   \
        EACH(packs) store(room + i * WIDE, y[i]);                                           \
        EACH(some) out[start + i] = room[i];                                                \
    }
#else
#define ENERGY_1 ENERGY_0
#endif

/* Energies of n bonds: in vectors, as the laws are inlined.  Not so above: the last bit of what is
   found there is in the numbers of other laws. */
#define ENERGY(K, IN_PACKS)                                                                 \
    if (law == K) {                                                                         \
        ALL_PARAMETERS(parameters[k])                                                       \
        ENERGY_##IN_PACKS(K)                                                                \
    }

__attribute__((flatten)) void energies(integer law, integer n, const real *restrict parameters,
                                       const real *restrict r, real *restrict out)
{
    ENERGIES(ENERGY)
}

#define ENERGY_OWN(K, IN_PACKS)                                                             \
    if (law == K)                                                                           \
        EACH(n) {                                                                           \
            ALL_PARAMETERS(parameters[k * n + i])                                           \
            out[i] = energy_##K(r[i], p);                                                   \
        }

__attribute__((flatten)) void energies_own(integer law, integer n, const real *restrict parameters,
                                           const real *restrict r, real *restrict out)
{
    ENERGIES(ENERGY_OWN)
}

#if VALUES
/* Of a law alone: its energy (order 0), tension or stiffness at n elongations, in vectors, as
   `energies` of evaluate.c. */

#define VALUE(K, ORDER, NAME)                                                               \
    if (law == K && order == ORDER && ORDER < 3) {                                          \
        ALL_PARAMETERS(parameters[k])                                                       \
        EACH(n) out[i] = NAME##_##K(r[i], p);                                               \
    }

__attribute__((flatten)) void values(integer law, integer order, integer n,
                                     const real *restrict parameters, const real *restrict r,
                                     real *restrict out)
{
    EVALUATIONS(VALUE)
}
#endif
