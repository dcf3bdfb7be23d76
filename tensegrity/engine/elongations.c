/* Elongations of contacts outside of a loop, with the geometry of the loop. */

typedef struct {
    const integer *first, *second;  /* (count) rows that a pair joins; of a wall, the site */
    const real *geometry;           /* (DIM + 2, count) D, g, L; `apart` is the stride of rows */
    integer apart;
} places;

#define ELONGATIONS(KIND, MOVED)                                                            \
    __attribute__((flatten)) void KIND##_elongations(                                       \
        const places *of, integer n, const real *restrict u, real *restrict out)            \
    {                                                                                       \
        const integer *restrict first = of->first, *restrict second = of->second;           \
        const real *restrict x = of->geometry;                                              \
        const integer next = of->apart, gap = DIM * next, length = gap + next;              \
        EACH(n) {                                                                           \
            real d[DIM], w[DIM], along[DIM], r;                                             \
            for (int k = 0; k < DIM; k++) d[k] = x[k * next + i], w[k] = MOVED;             \
            KIND##_contact(d, w, x[gap + i], x[length + i], &r, along);                     \
            out[i] = r;                                                                     \
        }                                                                                   \
    }

ELONGATIONS(pair, u[second[i] * DIM + k] - u[first[i] * DIM + k])
ELONGATIONS(wall, u[second[i] * DIM + k])
