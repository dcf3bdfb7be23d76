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
