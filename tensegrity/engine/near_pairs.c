/* Pairs of spheres with a gap below a bound.

   Points are sorted into cells wider than the largest distance of such a pair, so that partners are
   in the same cell or in cells that touch.  Cells have numbers modulo a power of two: those that
   touch have different ones, distant ones may share one, and the memory depends on the number of
   points only.  Points enter the cells in their order, and each meets the points of lower numbers,
   so that the partners of a point come out in order. */

#include <string.h>

typedef struct {
    const double *x, *radius;     /* (count, dim), (count) */
    const int *first, *second;    /* (bonds) ends of pairs to be left out */
    const integer *stride;        /* (dim) numbers of cells from one to the next along an axis */
    integer count, dim, bonds, cells;
    double edge, skin;            /* of a cell; bound of the gap */
    int *begin, *end;             /* (cells + 1), (cells) places of the points of each cell */
    int *number;                  /* (count) the point at each place */
    double *at;                   /* (count, 3) its coordinates, 0 beyond `dim` */
    int *last, *before;           /* (count), (bonds) */
    integer *place;               /* (count) number of pairs of each point, or where they begin */
    int *low, *high;              /* (pairs) */
    double *gap;                  /* (pairs) */
} spheres;

static integer cell_of(const spheres *s, integer point)
{
    unsigned long long found = 0;
    for (integer k = 0; k < s->dim; k++)
        found += s->stride[k] * (unsigned long long)(integer)floor(s->x[point * s->dim + k] / s->edge);
    return found & (s->cells - 1);
}

/* Begin of each cell, and for each point its last listed pair, each with that before it or -1. */
void near_cells(const spheres *s)
{
    memset(s->begin, 0, (s->cells + 1) * sizeof(int));
    for (integer i = 0; i < s->count; i++) s->begin[cell_of(s, i) + 1]++, s->last[i] = -1;
    for (integer c = 0; c < s->cells; c++) s->begin[c + 1] += s->begin[c];
    for (integer b = 0; b < s->bonds; b++) {
        const int i = s->first[b], j = s->second[b], low = i < j ? i : j;
        s->before[b] = s->last[low];
        s->last[low] = b;
    }
}

static int is_listed(const spheres *s, int i, int j)
{
    integer b = s->last[i];
    while (b >= 0 && s->first[b] + s->second[b] != i + j) b = s->before[b];
    return b >= 0;
}

/* Count the pairs of each point in `place`, or write them from there on. */
void near_sweep(const spheres *s)
{
    integer around[27] = {0}, sides = 1;
    for (integer k = 0; k < s->dim; k++, sides *= 3)
        for (integer m = 0; m < sides; m++) {
            around[sides + m] = around[m] - s->stride[k];
            around[2 * sides + m] = around[m] + s->stride[k];
        }
    memcpy(s->end, s->begin, s->cells * sizeof(int));
    const double most = s->edge * s->edge;
    for (integer j = 0; j < s->count; j++) {
        double x[3] = {0};
        memcpy(x, s->x + j * s->dim, s->dim * sizeof(double));
        const integer here = cell_of(s, j);
        for (integer m = 0; m < sides; m++) {
            const integer c = (here + around[m]) & (s->cells - 1);
            for (integer p = s->begin[c]; p < s->end[c]; p++) {
                double square = 0;
                for (int k = 0; k < 3; k++) {
                    const double d = x[k] - s->at[3 * p + k];
                    square += d * d;
                }
                if (square > most) continue;
                const int i = s->number[p];
                const double gap = sqrt(square) - s->radius[i] - s->radius[j];
                if (!(gap < s->skin) || is_listed(s, i, j)) continue;
                const integer pair = s->place[i]++;
                if (s->low) s->low[pair] = i, s->high[pair] = j, s->gap[pair] = gap;
            }
        }
        const integer p = s->end[here]++;
        s->number[p] = j;
        memcpy(s->at + 3 * p, x, sizeof x);
    }
}
