/* Chains: each bond joins neighbours, elongation u[j + 1] - u[j], one coordinate a site.

   Bonds come in runs of one law.  The bonds of a run share all parameters and one range, or have
   some parameters of their own and a range each: `line_law.c`, included once for each.

   Several chains run at once as lanes of the last axis: all entries of site j, one per lane, stand
   together, and the neighbour of an entry is LANES further. */

#define BLOCK 64
#ifndef LANES
#define LANES 1
#endif
/* Tensions of a block begin where a pack of several can. */
#define SIDE __attribute__((aligned(64)))
#define BEFORE ((WIDE - LANES % WIDE) % WIDE)
#define CARRY(n) for (int l = 0; l < LANES; l++) f[l] = f[(n) + l];

typedef struct {
    real *u, *v;                     /* displacement, velocity (sites, LANES) */
    const real *w;                   /* inverse mass; 0 holds a site (sites, LANES) */
    const real *shared;              /* (runs, PARAMETERS), what bonds of a run have in common */
    const real *own;                 /* for each run (own parameters of its law, bonds, LANES) */
    const real *kicks, *drifts;      /* dt times the coefficients (stages + 1), (stages) */
    real *low, *high;                /* smallest and largest elongation met: for each run those at
                                        each place of a block, BLOCK or less, or where it has own
                                        parameters (bonds, LANES) */
    const integer *first;            /* (runs + 1) first bond of each run */
    const integer *law;              /* (runs) twice the law, and 1 more with own parameters */
    const integer *own_at;           /* (runs) where its own parameters begin */
    const integer *met_at;           /* (runs + 1) where its elongations begin */
    integer runs, stages, closing;   /* closing: the method ends with a kick */
} scene;
