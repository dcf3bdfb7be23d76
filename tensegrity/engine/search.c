/* How far springs come with an energy, and how stiff or tense they get on the way.

   Compiled once for all scenes, without contraction of products and sums: what is looked at are
   the points of NumPy, shares of the way between two elongations. */

#include <math.h>

typedef long long integer;
typedef void (*law)(integer, integer, integer, const double *, const double *, double *);

typedef struct {
    const law *functions;      /* (springs) `values` of values.c, of the law of each */
    const double *parameters;  /* (springs, width) */
    const double *domains;     /* (springs, 2) */
    integer width;
} springs;

enum { ENERGY, TENSION, STIFFNESS, BLOCK = 64 }; /* points that one call of a law evaluates */

/* Points at shares of the way from `a` to `b`, and what a spring has there. */
static void look(const springs *s, integer spring, integer order, double a, double b,
                 const double *shares, integer n, double *restrict r, double *restrict values)
{
    for (integer i = 0; i < n; i++) r[i] = shares[i] == 1 ? b : a + shares[i] * (b - a);
    s->functions[spring](0, order, n, s->parameters + spring * s->width, r, values);
}

/* For each of `count` ways from 0 to an end, of the springs of these numbers: the first point with
   more than an energy, or else the last; looked for once with the shares of each of `looks`
   (looks + 1: where they begin), on the way that is left, from the point before it to it, or from 0
   where it was the first.  `found` is whether there was one at first. */
void first(const springs *s, double energy, integer count, const integer *numbers,
           const double *ends, const double *shares, const integer *begins, integer looks,
           double *last, unsigned char *found)
{
    double r[BLOCK], values[BLOCK];
    for (integer k = 0; k < count; k++) {
        double before = 0, beyond = ends[k];
        for (integer m = 0; m < looks; m++) {
            const integer stop = begins[m + 1];
            double inside = 0, outside = 0;
            integer is_out = 0;
            for (integer i = begins[m]; i < stop && !is_out; i += BLOCK) {
                const integer n = stop - i < BLOCK ? stop - i : BLOCK;
                look(s, numbers[k], ENERGY, before, beyond, shares + i, n, r, values);
                integer j = 0;
                while (j < n && values[j] <= energy) j++;
                is_out = j < n;
                if (is_out) outside = r[j];
                if (j) inside = r[j - 1];
            }
            before = inside;
            beyond = is_out ? outside : inside;
            if (!m) found[k] = is_out;
        }
        last[k] = beyond;
    }
}

static double size(const springs *s, double energy, integer spring, double sign,
                   const double *sizes, integer every)
{
    double r[BLOCK], values[BLOCK], stiffness[BLOCK], last = 0;
    integer begun = 0;
    for (integer i = 0; i < every; i += BLOCK) {
        const integer n = every - i < BLOCK ? every - i : BLOCK;
        look(s, spring, ENERGY, 0, sign, sizes + i, n, r, values);
        look(s, spring, STIFFNESS, 0, sign, sizes + i, n, r, stiffness);
        for (integer j = 0; j < n; j++) {
            const integer known = isfinite(stiffness[j]) != 0;
            if (begun && !known) return last;
            begun |= known;
            last = r[j];
            if (begun && !(values[j] <= energy)) return last;
        }
    }
    return last;
}

/* For each of `count` ways without an end, to a side given by its sign, the first size with more
   than an energy, or else the last, of those from the first to the last in a row at which the
   stiffness is finite. */
void first_size(const springs *s, double energy, integer count, const integer *numbers,
                const double *signs, const double *sizes, integer every, double *last)
{
    for (integer k = 0; k < count; k++)
        last[k] = size(s, energy, numbers[k], signs[k], sizes, every);
}

/* Largest tension by size, or stiffness, at least 0, of springs of these numbers at shares of their
   ranges (count, 2); not a number where one of them is none.  Whether ranges are in the domains. */
integer largest(const springs *s, integer order, integer count, const integer *numbers,
                const double *ranges, const double *shares, integer every, double *out)
{
    double r[BLOCK], values[BLOCK];
    for (integer k = 0; k < count; k++) {
        const double *domain = s->domains + 2 * numbers[k];
        double top = 0, none = 0;
        for (integer side = 0; side < 2; side++) {
            const double end = ranges[2 * k + side];
            if (!(end > domain[0] && end < domain[1])) return 0;
            for (integer i = 0; i < every; i += BLOCK) {
                const integer n = every - i < BLOCK ? every - i : BLOCK;
                look(s, numbers[k], order, 0, end, shares + i, n, r, values);
                for (integer j = 0; j < n; j++) {
                    const double x = order == TENSION ? fabs(values[j]) : values[j];
                    if (x > top) top = x;
                    if (x != x) none = x;
                }
            }
        }
        out[k] = top + none;
    }
    return 1;
}
