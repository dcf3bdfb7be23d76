/* How far springs come with an energy, and how stiff or tense they get on the way.

   Compiled once for all scenes, without contraction of products and sums: what is looked at are
   the points of NumPy, shares of the way between two elongations. */

typedef void (*law)(integer, integer, integer, const double *, const double *, double *);

typedef struct {
    const law *functions;      /* (springs) `values` of values.c, of the law of each */
    const double *parameters;  /* (springs, width) */
    const double *domains;     /* (springs, 2) */
    integer width;
} springs;

/* Shares of a way at which to look in turn, those of each look from where it begins. */
typedef struct {
    const double *shares;
    const integer *begins; /* (count + 1) */
    integer count;
} looks;

enum { ENERGY, TENSION, STIFFNESS, BLOCK = 64 }; /* points that one call of a law evaluates */

/* Points at shares of the way from `a` to `b`, and what a spring has there. */
static void look(const springs *s, integer spring, integer order, double a, double b,
                 const double *shares, integer n, double *restrict r, double *restrict values)
{
    for (integer i = 0; i < n; i++) r[i] = shares[i] == 1 ? b : a + shares[i] * (b - a);
    s->functions[spring](0, order, n, s->parameters + spring * s->width, r, values);
}

/* The first elongation with more than an energy on the way from 0 to an end, or else the last.
   Each look but the first is between what the one before it found and the last point, of any
   look, that is not so far.  `found` is whether the first look found one. */
static double first(const springs *s, double energy, integer spring, double end, const looks *of,
                    integer *found)
{
    double r[BLOCK], values[BLOCK], before = 0, beyond = end;
    for (integer m = 0; m < of->count; m++) {
        const integer stop = of->begins[m + 1];
        double inside = before, outside = 0;
        integer is_out = 0;
        for (integer i = of->begins[m]; i < stop && !is_out; i += BLOCK) {
            const integer n = stop - i < BLOCK ? stop - i : BLOCK;
            look(s, spring, ENERGY, before, beyond, of->shares + i, n, r, values);
            integer j = 0;
            while (j < n && values[j] <= energy) j++;
            is_out = j < n;
            if (is_out) outside = r[j];
            if (j) inside = r[j - 1];
        }
        before = inside;
        beyond = is_out ? outside : inside;
        if (!m) *found = is_out;
    }
    return beyond;
}

/* The first of some sizes with more than an energy, to the side of a sign, or else the last; of
   those in a row, from the first one, at which the stiffness is finite. */
static double size(const springs *s, double energy, integer spring, double sign, const looks *of)
{
    double r[BLOCK], values[BLOCK], stiffness[BLOCK], last = 0;
    const integer stop = of->begins[1];
    integer begun = 0;
    for (integer i = 0; i < stop; i += BLOCK) {
        const integer n = stop - i < BLOCK ? stop - i : BLOCK;
        look(s, spring, ENERGY, 0, sign, of->shares + i, n, r, values);
        look(s, spring, STIFFNESS, 0, sign, of->shares + i, n, r, stiffness);
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

/* What `count` springs reach with an energy, (count, 2), and whether that is an end of the domain.
   `ways`: how to look where the domain has an end; sizes, and up to one of them, where not. */
void reachable(const springs *s, double energy, integer count, const looks *ways, double *ranges,
               unsigned char *locks)
{
    for (integer k = 0; k < count; k++) {
        locks[k] = 0;
        for (integer side = 0; side < 2; side++) {
            const double end = s->domains[2 * k + side];
            const integer held = isfinite(end) != 0;
            const double way = held ? end : size(s, energy, k, side ? 1 : -1, ways + 1);
            integer found;
            ranges[2 * k + side] = first(s, energy, k, way, ways + (held ? 0 : 2), &found);
            locks[k] |= held && !found;
        }
    }
}

/* Largest tension by size, or stiffness, at least 0, of springs of these numbers, or of the
   first ones, at shares of their ranges (count, 2); not a number where one of them is none.
   Returns 0 where a range is not inside of the domain, 2 where all that was found is finite, else
   1. */
integer largest(const springs *s, integer order, integer count, const integer *numbers,
                const double *ranges, const double *shares, integer every, double *out)
{
    double r[BLOCK], values[BLOCK];
    integer found = 2;
    for (integer k = 0; k < count; k++) {
        const integer spring = numbers ? numbers[k] : k;
        const double *domain = s->domains + 2 * spring;
        double top = 0, none = 0;
        for (integer side = 0; side < 2; side++) {
            const double end = ranges[2 * k + side];
            if (!(end > domain[0] && end < domain[1])) return 0;
            for (integer i = 0; i < every; i += BLOCK) {
                const integer n = every - i < BLOCK ? every - i : BLOCK;
                look(s, spring, order, 0, end, shares + i, n, r, values);
                for (integer j = 0; j < n; j++) {
                    const double x = order == TENSION ? fabs(values[j]) : values[j];
                    if (x > top) top = x;
                    if (x != x) none = x;
                }
            }
        }
        out[k] = top + none;
        if (!isfinite(out[k])) found = 1;
    }
    return found;
}
