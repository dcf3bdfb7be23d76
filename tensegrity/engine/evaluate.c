/* Derivatives of the laws, outside of a loop; EVALUATIONS(X) lists X(K, order, name). */

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

/* Energies of n bonds: in vectors, as the laws are inlined.  Not so above: the last bit of what is
   found there is in the numbers of other laws. */
#define ENERGY(K, ORDER, NAME)                                                              \
    if (law == K && ORDER == 0) {                                                           \
        ALL_PARAMETERS(parameters[k])                                                       \
        EACH(n) out[i] = NAME##_##K(r[i], p);                                               \
    }

__attribute__((flatten)) void energies(integer law, integer n, const real *restrict parameters,
                                       const real *restrict r, real *restrict out)
{
    EVALUATIONS(ENERGY)
}

#define ENERGY_OWN(K, ORDER, NAME)                                                          \
    if (law == K && ORDER == 0)                                                             \
        EACH(n) {                                                                           \
            ALL_PARAMETERS(parameters[k * n + i])                                           \
            out[i] = NAME##_##K(r[i], p);                                                   \
        }

__attribute__((flatten)) void energies_own(integer law, integer n, const real *restrict parameters,
                                           const real *restrict r, real *restrict out)
{
    EVALUATIONS(ENERGY_OWN)
}
