/* Energies of many states of a chain or a network; elongations that springs reach with an energy,
   and their largest stiffness or tension up to there.

   Compiled once for all scenes, without contraction of products and sums: kinetic and stored energy
   are summed pairwise in the order of NumPy, so that results agree to the bit for any number of
   states in a call; the sampling points are those of NumPy, fractions of the distance between two
   elongations. */

typedef void (*law)(integer order, integer n, const double *parameters, const double *r,
                    double *out);
typedef void (*elongation_function)(const void *, integer, integer, const double *, double *);

enum { ENERGY, TENSION, STIFFNESS, BLOCK = 64 }; /* points that one call of a law evaluates */

/* Bonds of one law and of one spring, or of several.  At most `most` are evaluated in one call. */
typedef struct {
    void *function;             /* a `law`: `values`, or of several `values_own`, of evaluate.c */
    void *elongations;          /* of elongations.c; 0 for neighbours on a line */
    const double *parameters;   /* (parameters, different) */
    const double *low, *high;   /* (different) ends of the domain */
    const int *spring;          /* (count) the spring of each bond; 0 where there is one */
    const integer *members;     /* (count) numbers of the bonds; 0 where they are consecutive */
    const void *places;         /* argument of `elongations` */
    integer different, own;     /* numbers of springs, and of parameters of each bond, or 0 */
    integer most, count, start; /* start: place of the first */
} bond_set;

static double pairwise_sum(const double *x, integer n)
{
    if (n < 8) {
        double sum = 0;
        for (integer i = 0; i < n; i++) sum += x[i];
        return sum;
    }
    if (n > 128) {
        integer half = n / 2;
        half -= half % 8;
        return pairwise_sum(x, half) + pairwise_sum(x + half, n - half);
    }
    double s[8];
    integer i = 8;
    for (int k = 0; k < 8; k++) s[k] = x[k];
    for (; i < n - n % 8; i += 8)
        for (int k = 0; k < 8; k++) s[k] += x[i + k];
    double sum = ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
    for (; i < n; i++) sum += x[i];
    return sum;
}

/* Elongations of the bonds of a set from `begin` to `end`; returns whether all are in the domain,
   which NaN is not. */
static integer elongations(const bond_set *s, integer begin, integer end, const double *u,
                           double *restrict r)
{
    const integer *members = s->members + begin, n = end - begin;
    integer outside = 0;
    if (s->elongations) {
        ((elongation_function)s->elongations)(s->places, begin, end, u, r);
    } else if (!s->members) {
        u += s->start + begin;
        for (integer i = 0; i < n; i++) r[i] = u[i + 1] - u[i];
    } else {
        for (integer i = 0; i < n; i++) r[i] = u[members[i] + 1] - u[members[i]];
    }
    if (s->different > 1) {
        const int *spring = s->spring + begin;
        for (integer i = 0; i < n; i++)
            outside |= !(r[i] >= s->low[spring[i]]) | !(r[i] <= s->high[spring[i]]);
    } else {
        const double low = *s->low, high = *s->high;
        for (integer i = 0; i < n; i++) outside |= !(r[i] >= low) | !(r[i] <= high);
    }
    return !outside;
}

/* Parameters of bonds `begin` to `end` of a set, (parameters, end - begin) where it has several
   springs. */
static const double *parameters(const bond_set *s, integer begin, integer end, double *restrict p)
{
    if (!s->own) return s->parameters;
    for (integer k = 0; k < s->own; k++)
        for (integer i = begin; i < end; i++)
            p[k * (end - begin) + i - begin] =
                s->parameters[k * s->different + (s->spring ? s->spring[i] : 0)];
    return p;
}

/* Total energy of each of `rows` states with so many `entries`; returns 0 where an elongation is
   outside its domain.  `mass` is that of so many entries `each`; `loads` is 0 without loads.
   `scratch` has one
   number for each of `all` bonds, then the larger of `entries` and the bonds of a call, then the
   parameters of these. */
integer energies(const bond_set *sets, integer count, integer all, const double *mass,
                 integer each, const double *loads, integer entries, integer rows, const double *u,
                 const double *v, double *scratch, double *total)
{
    FLUSH
    integer most = entries;
    for (integer s = 0; s < count; s++) most = sets[s].most > most ? sets[s].most : most;
    double *restrict stored = scratch, *restrict part = scratch + all, *own = part + most;
    for (integer k = 0; k < rows; k++, u += entries, v += entries) {
        for (integer s = 0; s < count; s++) {
            const bond_set *set = sets + s;
            for (integer b = 0; b < set->count; b += set->most) {
                const integer end = b + set->most < set->count ? b + set->most : set->count;
                if (!elongations(set, b, end, u, part)) return 0;
                double *out = set->members ? part : stored + set->start + b;
                ((law)set->function)(ENERGY, end - b, parameters(set, b, end, own), part, out);
                if (set->members)
                    for (integer i = b; i < end; i++) stored[set->members[i]] = part[i - b];
            }
        }
        for (integer k = 0; k < each; k++)
            for (integer q = 0, i = k; i < entries; q++, i += each)
                part[i] = mass[q] * (v[i] * v[i]);
        total[k] = 0.5 * pairwise_sum(part, entries) + pairwise_sum(stored, all);
        if (!loads) continue;
        for (integer i = 0; i < entries; i++) part[i] = loads[i] * u[i];
        total[k] -= pairwise_sum(part, entries);
    }
    return 1;
}

typedef struct {
    const law *functions;      /* (springs) `values` of evaluate.c, of the law of each */
    const double *parameters;  /* (springs, width) */
    const double *domains;     /* (springs, 2) */
    integer width;
} springs;

/* Fractions of a distance at which to sample, those of each pass from its entry of `begins` on. */
typedef struct {
    const double *fractions;
    const integer *begins; /* (count + 1) */
    integer count;
} search_grid;

/* Points at fractions of the distance from `a` to `b`, and the values of a spring there. */
static void sample(const springs *s, integer spring, integer order, double a, double b,
                 const double *fractions, integer n, double *restrict r, double *restrict values)
{
    for (integer i = 0; i < n; i++) r[i] = fractions[i] == 1 ? b : a + fractions[i] * (b - a);
    s->functions[spring](order, n, s->parameters + spring * s->width, r, values);
}

/* The first elongation between 0 and an end with more than an energy, or else the last one.  Each
   pass after the first samples between the points that bracket it in the pass before.  `found`
   tells whether the first pass found one. */
static double first(const springs *s, double energy, integer spring, double end,
                    const search_grid *of, integer *found)
{
    double r[BLOCK], values[BLOCK], before = 0, beyond = end;
    for (integer m = 0; m < of->count; m++) {
        const integer stop = of->begins[m + 1];
        double inside = before, outside = 0;
        integer is_out = 0;
        for (integer i = of->begins[m]; i < stop && !is_out; i += BLOCK) {
            const integer n = stop - i < BLOCK ? stop - i : BLOCK;
            sample(s, spring, ENERGY, before, beyond, of->fractions + i, n, r, values);
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

/* The first of some sizes, times a sign, with more than an energy, or else the last one; only the
   first consecutive sizes with a finite stiffness count. */
static double size(const springs *s, double energy, integer spring, double sign,
                   const search_grid *of)
{
    double r[BLOCK], values[BLOCK], stiffness[BLOCK], last = 0;
    const integer stop = of->begins[1];
    integer begun = 0;
    for (integer i = 0; i < stop; i += BLOCK) {
        const integer n = stop - i < BLOCK ? stop - i : BLOCK;
        sample(s, spring, ENERGY, 0, sign, of->fractions + i, n, r, values);
        sample(s, spring, STIFFNESS, 0, sign, of->fractions + i, n, r, stiffness);
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

/* Elongations that `count` springs reach with an energy, (count, 2), and whether they include an
   end of the domain.  `grids`: up to an end of the domain; sizes where it is unbounded; up to
   one. */
void reachable(const springs *s, double energy, integer count, const search_grid *grids,
               double *ranges, unsigned char *locks)
{
    for (integer k = 0; k < count; k++) {
        locks[k] = 0;
        for (integer side = 0; side < 2; side++) {
            const double end = s->domains[2 * k + side];
            const integer held = isfinite(end) != 0;
            const double way = held ? end : size(s, energy, k, side ? 1 : -1, grids + 1);
            integer found;
            ranges[2 * k + side] = first(s, energy, k, way, grids + (held ? 0 : 2), &found);
            locks[k] |= held && !found;
        }
    }
}

/* Largest absolute tension, or stiffness, at least 0, of springs of given numbers, or of the
   first ones, at fractions of their ranges (count, 2); NaN where a sample is NaN. Returns 0
   where a range is not inside the domain, 2 where all results are finite, otherwise 1. */
integer largest(const springs *s, integer order, integer count, const integer *numbers,
                const double *ranges, const double *fractions, integer every, double *out)
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
                sample(s, spring, order, 0, end, fractions + i, n, r, values);
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
