/* Chains, and masses on a line, in the plane or in space joined by contacts in any pattern.

   In a chain each bond joins neighbours, elongation u[j + 1] - u[j], one coordinate a site.  Bonds
   come in runs of one law, whose bonds share all parameters and one range, or have some parameters
   of their own and a range each: `line_law.c`, included once for each.  Several chains run at once
   as lanes of the last axis: all entries of site j, one per lane, stand together, and the
   neighbour of an entry is BATCH further.

   Rows of a network's u and v: the sites, the walls, one more that takes what is left over.  A
   wall's row collects its impulse in v.  The list of contacts comes in runs of one kind and one
   law.  The forces are computed from a second list: GROUP sites stand side by side in a slice, and
   their contacts with sites of higher numbers, or with walls, in its groups.  A site adds these up
   in a register, and they are added to the other sites' rows with the opposite sign: equal to the
   last bit.  What does not count in a group repeats another contact.  Slices come in tiles of TILE
   sites, which move as soon as the contacts of their tile are done.  A thread has tiles, and rows
   of forces of its own, and does the contacts of the tiles before them again that act on its
   sites: no sum depends on the number of threads. */

#define TILE 256
#ifndef BATCH
#define BATCH 1
#endif
#ifdef DIM
#define AXES(k) for (int k = 0; k < DIM; k++)
#endif

typedef struct {
    real *u, *v;                     /* displacement, velocity (sites, BATCH), (rows, DIM) */
    const real *w;                   /* like these, inverse mass; 0 holds a site */
    const real *shared;              /* (runs, PARAMETERS), what bonds of a run have in common */
    const real *own;                 /* for each run (own parameters of its law, bonds, BATCH), of a
                                        network (those, entries) */
    const real *kicks, *drifts;      /* dt times the coefficients (stages + 1), (stages) */
    real *low, *high;                /* smallest and largest elongation met: for each run those at
                                        each place of a block, BLOCK or less, in a network GROUP of
                                        each piece, or where it has own parameters (bonds, BATCH),
                                        (entries) */
    const integer *first;            /* (runs + 1) first bond of each run */
    const integer *law;              /* (runs) twice the law, and 1 more with own parameters; of a
                                        network 4 times the law, 2 more for walls, 1 for own */
    const integer *own_at;           /* (runs) where its own parameters begin */
    const integer *range_at;           /* (runs + 1) where its elongations begin */
    integer runs, stages, closing;   /* closing: the method ends with a kick */

    /* The rest is of networks. */
    const real *load;                   /* (rows, DIM) constant forces */
    const real *geometry;               /* (DIM + 2, contacts) D, g, L */
    real *travel;                       /* bound on how far any coordinate of a site moved */
    const integer *from, *to;           /* (contacts) where their rows begin; a wall is `from` */
    const real *places;                 /* (rows + 1, DIM) reference positions */
    real *near;                         /* (2, rows, DIM) displacements that threads have in common */
    const integer *slice;               /* (runs, tiles + 1) first slice of a run in each tile */
    const int *site;                    /* (slices, GROUP) sites */
    const integer *begin;               /* (slices + 1) first group of each slice */
    const int *other;                   /* (groups, GROUP) the other site; of a wall, none */
    const unsigned char *counts;        /* (groups) a bit for each that counts */
    const integer *entry;               /* (runs + 1) first entry (of a group) of each run */
    const real *gap, *length;           /* for each run those of its entries, or GROUP equal ones */
    const integer *gap_at, *length_at;  /* (runs) where these begin */
    const integer *gap_each, *length_each; /* (runs) whether each entry has its own */
    real *pull;                         /* (pieces, sites, ROW) forces on sites so far */
    const real *normal;                 /* for each run with walls, (groups, DIM, GROUP) */
    const integer *normal_at;           /* (runs) where these begin */
    real *press, *force;                /* like `normal`, forces on walls by each contact, and
                                           (rows - sites, DIM) their sums */
    const integer *pressing, *pressed;  /* where those of each contact are, wall by wall, and
                                           (rows - sites + 1) where those of each wall begin */
    real *farthest;                     /* (pieces) of the sites in this stage */
    integer *gate;                      /* (16) where threads wait for each other */
    integer contacts, sites, rows, tiles, loaded;
    integer before, tile, last_tile, reach, piece, pieces; /* what this thread does */
} scene;
