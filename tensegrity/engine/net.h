/* Masses on a line, in the plane or in space, joined by contacts in any pattern.

   The generated geometry gives DIM coordinates, and pair_contact and wall_contact of (reference D,
   difference w, initial gap g, length L), which give the elongation r and its gradient n in w.

   Rows of u, v and force: the sites, the walls, one more that takes what is left over.  A wall's
   row collects its impulse in v.  Contacts come in runs of one kind and one law, filled up to
   whole groups of GROUP: every contact is computed by the same instructions wherever it stands
   in the list, so that equal neighbourhoods feel equal forces to the last bit, and the sums at a
   site are taken in the order of the list. */

#define GROUP 8

typedef struct {
    real *u, *v, *force;                /* (rows, DIM) */
    const real *w;                      /* (rows, DIM) inverse mass; 0 holds a site */
    const real *load;                   /* (rows, DIM) constant forces */
    const real *geometry;               /* (DIM + 2, contacts) D, g, L */
    const real *shared;                 /* (runs, PARAMETERS) */
    const real *own;                    /* for each run (own parameters of its law, its contacts) */
    const real *kicks, *drifts;         /* dt times the coefficients (stages + 1), (stages) */
    real *low, *high;                   /* (contacts) smallest and largest elongation met */
    real *travel;                       /* bound on how far any coordinate of a site moved */
    const integer *from, *to;           /* (contacts) where their rows begin; a wall is `from` */
    const integer *first;               /* (runs + 1) first contact of each run */
    const integer *law;                 /* (runs) 4 times the law, 2 more for walls, 1 for own */
    const integer *own_at;              /* (runs) where its own parameters begin */
    integer runs, contacts, sites, rows, stages, closing;
} scene;

/* Unrolled first, the loop would be taken apart into scalars and branches. */
#define WHOLE_GROUP _Pragma("GCC unroll 1") EACH(GROUP)
#define AXES(k) for (int k = 0; k < DIM; k++)
/* The force is rounded before it is added to one site and subtracted from the other: contracted
   with the sums the two would differ, and mirrored sites with them. */
#define ROUNDED(array) __asm__("" : "+m"(array));
