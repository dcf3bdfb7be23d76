/* Elongations of contacts outside of a loop, from `begin` to `end` of a set. */

typedef struct {
    const int *first, *second;     /* (count) rows that a contact joins; `first` may be a wall */
    const real *at;                /* (rows, DIM) reference places, and the normals of walls */
    const real *gap, *length;      /* (count), or one of all where the step is 0 */
    integer gap_step, length_step;
    const real *parameters;        /* (springs, PARAMETERS) of a law of both ends */
    const int *spring;             /* (count) that of each contact; 0 where there is one */
} places;

/* On a line the direction from the first site to the second counts. */
static inline real separation(const real *at, integer from, integer to, int k)
{
    const real d = at[to * DIM + k] - at[from * DIM + k];
    return DIM > 1 ? d : (d > 0) - (d < 0);
}

#define ELONGATIONS(KIND, PLACE, MOVED)                                                     \
    __attribute__((flatten)) void KIND##_elongations(                                       \
        const places *of, integer begin, integer end, const real *restrict u,               \
        real *restrict out)                                                                 \
    {                                                                                       \
        const int *restrict first = of->first + begin, *restrict second = of->second + begin; \
        const real *restrict at = of->at, *restrict gaps = of->gap, *restrict sizes = of->length; \
        const integer each_gap = of->gap_step, each_size = of->length_step;                 \
        EACH(end - begin) {                                                                 \
            const integer p = first[i], q = second[i];                                      \
            const real gap = gaps[(begin + i) * each_gap], size = sizes[(begin + i) * each_size]; \
            real d[DIM], w[DIM], along[DIM], r;                                             \
            for (int k = 0; k < DIM; k++) d[k] = PLACE, w[k] = MOVED;                       \
            KIND##_contact(d, w, gap, size, &r, along);                                     \
            out[i] = r;                                                                     \
        }                                                                                   \
    }

#ifdef ENDS
void pair_elongations(const places *of, integer begin, integer end, const real *restrict u,
                      real *restrict out)
{
    real along[2 * DIM];
    for (integer i = begin; i < end; i++)
        pair_of_ends(u + of->first[i] * DIM, u + of->second[i] * DIM,
                     of->parameters + (of->spring ? of->spring[i] * PARAMETERS : 0), out + i - begin,
                     along);
}
#else
ELONGATIONS(pair, separation(at, p, q, k), u[q * DIM + k] - u[p * DIM + k])
#endif
ELONGATIONS(wall, at[p * DIM + k], u[q * DIM + k])
