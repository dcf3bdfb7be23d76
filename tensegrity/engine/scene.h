/* Chains, and masses on a line, in the plane or in space joined by contacts in any pattern.

   In a chain each bond joins neighbours, elongation u[j + 1] - u[j], with one coordinate per
   site.  Bonds are grouped in runs of one law, whose bonds have all parameters and one elongation
   range in common, or have parameters and ranges of their own: `line_law.c`, included once for
   each kind.  A batch of chains is advanced in one loop: the BATCH entries of site j are
   adjacent, and the neighbour of an entry is BATCH further.  A ring has one more site, of no mass:
   the image of the first one, `stretch` further, to which the last bond leads; see `close_ring`.

   The rows of u and v of a network are the sites, the walls, and one spare row.  The row of a
   wall collects its impulse in v.  The list of contacts is divided in runs of one kind and one
   law.  The forces are computed from a second list: a slice holds GROUP sites, and its groups
   their contacts with sites of higher numbers, or with walls.  A site sums these forces in a
   register, and they are added to the rows of the other sites with the opposite sign, equal to
   the last bit.  Entries of a group that do not count repeat another contact.  A tile holds the
   slices of TILE sites, which are advanced as soon as the contacts of the tile are computed.  A
   thread has tiles, and rows of forces of its own, and computes again the contacts of earlier
   tiles that act on its sites: no sum depends on the number of threads. */

#define TILE 256
#ifndef BATCH
#define BATCH 1
#endif
#ifdef DIM
#define AXES(k) for (int k = 0; k < DIM; k++)
#endif

typedef struct {
    real *u, *v;                     /* displacement, velocity (sites, BATCH), (rows, DIM) */
    const real *w;                   /* of the same shape, inverse mass; 0 for a fixed site */
    const real *shared;              /* (runs, PARAMETERS), common parameters of a run */
    const real *own;                 /* for each run (own parameters of its law, places), of a
                                        network (those, entries) */
    const real *kicks, *drifts;      /* dt times the coefficients (stages + 1), (stages) */
    real *low, *high;                /* smallest and largest elongations: for each run those at each
                                        place of a block, BLOCK or less, in a network GROUP of each
                                        thread; with own parameters those of each bond (bonds,
                                        BATCH), or of a block that repeats, (entries) */
    const integer *first;            /* (runs + 1) first bond of each run */
    const integer *law;              /* (runs) twice the law, and 1 more with own parameters; of a
                                        network 4 times the law, 2 more for walls, 1 for own */
    const integer *own_at;           /* (runs) where its own parameters begin */
    const integer *range_at;           /* (runs + 1) where its elongations begin */
    integer runs, stages, closing;   /* closing: the method ends with a kick */
    integer *active;                 /* of a chain (2): entries that may move, the others are at
                                        rest; steps for which that holds.  Of a network (1 + tiles):
                                        number of this stage; for each tile that of the last stage
                                        in which it may move.  0: all may move */
    real (*stage)(const void *, real, real); /* of the loop, for steps compiled apart from it */
    const real *stretch;             /* of a ring, what its elongations sum up to; 0 of others */

    /* The other fields are those of networks. */
    const real *load;                   /* (rows, DIM) constant forces */
    const real *geometry;               /* (DIM + 2, contacts) D, g, L */
    real *travel;                       /* bound on how far any coordinate of a site moved */
    const int *from, *to;               /* (contacts) where their rows begin; a wall is `from` */
    const real *places;                 /* (rows + 1, DIM) reference positions */
    real *near;                         /* (2, rows, DIM) displacements shared by threads */
    const integer *slice;               /* (runs, tiles + 1) first slice of a run in each tile */
    const int *site;                    /* (slices, GROUP) sites */
    const integer *beside, *beside_at;  /* tiles with contacts with each tile, and it; (tiles + 1) */
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
    const integer *pressing, *pressed;  /* places of those of each contact, sorted by wall, and
                                           (rows - sites + 1) the first of each wall */
    real *farthest;                     /* (pieces) largest displacement in this stage */
    integer *gate;                      /* (16) barrier of the threads */
    const integer *coupled;             /* (couplings, 2) rows of operations of bonds with mass:
                                           coupled[0] -= factor coupled[1] */
    const real *coupling;               /* (couplings, DIM) the factors */
    real *spread;                       /* scratch (rows, DIM) of bonds with mass */
    integer couplings;
    const integer *strung;              /* (runs) whether a run has segments of cables over sites */
    const int *strand;                  /* (segments, 2) rows of their ends, cable by cable */
    const real *strand_geometry;        /* (segments, DIM + 2) D, g, L */
    const integer *strand_at;           /* (cables + 1) the first segment of each */
    const integer *strand_place;        /* (segments) their places in the list */
    const integer *mean_entry, *mean_at; /* the entries of its segments, (cables + 1) where these
                                           begin */
    real *mean, *least;                 /* scratch (entries) mean elongation of the segments, and
                                           the least, of those that turned round minus their
                                           length */
    real *average, *toward;             /* scratch (cables, 2) of the same, (segments, DIM) their
                                           vectors in the last stage; 0 where a motion begins */
    integer cables;
    integer contacts, sites, rows, tiles, loaded;
    integer before, tile, last_tile, reach, piece, pieces; /* the part of this thread */
} scene;

#define ALL_MAY_MOVE(c) (c).active = 0;

#ifndef DIM
/* Of a ring: place the image of the first site, which takes its velocity. */
static inline void close_ring(const scene *c, real *u, real *v)
{
    if (!c->stretch) return;
    const integer end = BATCH * c->first[c->runs];
    for (int l = 0; l < BATCH; l++) u[end + l] = u[l] + *c->stretch, v[end + l] = v[l];
}
#define CLOSE_RING(c, u, v) close_ring(c, u, v);
#else
#define CLOSE_RING(c, u, v)
#endif

/* Steps that do not depend on the laws are compiled once for all of them, with STEPPER defined, and
   call the stage of a loop through its address. */
#ifdef STEPPER
#define stage(c, a, b) (c)->stage(c, a, b)
#endif
