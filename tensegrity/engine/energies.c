/* Energies of many states of a chain or a network.

   Compiled once for all scenes, without contraction of products and sums: kinetic and stored
   energy are summed in the order of NumPy, by pairs, so that it makes no difference to a bit how
   many states are asked for at once, or by whom. */

typedef void (*bonds)(integer, integer, const double *, const double *, double *);
typedef void (*stretch)(const void *, integer, const double *, double *);

/* Bonds that one call evaluates: of one spring, or of one law with parameters of each. */
typedef struct {
    void *function;             /* `energies` or `energies_own` of evaluate.c */
    void *elongations;          /* of elongations.c; 0 for neighbours on a line */
    const double *parameters;   /* (parameters,), or (parameters, count) */
    const double *low, *high;   /* (count) ends of the domain, or one of each */
    const integer *members;     /* (count) places of the bonds; 0 where they are in a row */
    const void *places;         /* what `elongations` takes */
    integer own, count, start;  /* start: place of the first */
} alike;

static double in_pairs(const double *x, integer n)
{
    if (n < 8) {
        double sum = 0;
        for (integer i = 0; i < n; i++) sum += x[i];
        return sum;
    }
    if (n > 128) {
        integer half = n / 2;
        half -= half % 8;
        return in_pairs(x, half) + in_pairs(x + half, n - half);
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

/* Elongations of some bonds, side by side; whether all are in the domain, which NaN is not. */
static integer elongations(const alike *s, const double *u, double *restrict r)
{
    integer outside = 0;
    if (s->elongations) {
        ((stretch)s->elongations)(s->places, s->count, u, r);
    } else if (!s->members) {
        u += s->start;
        for (integer i = 0; i < s->count; i++) r[i] = u[i + 1] - u[i];
    } else {
        for (integer i = 0; i < s->count; i++) r[i] = u[s->members[i] + 1] - u[s->members[i]];
    }
    if (s->own) {
        for (integer i = 0; i < s->count; i++)
            outside |= !(r[i] >= s->low[i]) | !(r[i] <= s->high[i]);
    } else {
        const double low = *s->low, high = *s->high;
        for (integer i = 0; i < s->count; i++) outside |= !(r[i] >= low) | !(r[i] <= high);
    }
    return !outside;
}

/* Total energy of each of `rows` states of so many `entries`; 0 where an elongation is outside of
   its domain.  `mass` is that of each entry; `loads` 0 where there are none.  `scratch` takes one
   number for each of `all` bonds, and behind them as many as `entries` or one set has bonds. */
integer energies(const alike *sets, integer count, integer all, const double *mass,
                 const double *loads, integer entries, integer rows, const double *u,
                 const double *v, double *scratch, double *total)
{
    FLUSH
    double *restrict stored = scratch, *restrict part = scratch + all;
    for (integer k = 0; k < rows; k++, u += entries, v += entries) {
        for (integer s = 0; s < count; s++) {
            const alike *set = sets + s;
            const integer n = set->count;
            if (!elongations(set, u, part)) return 0;
            double *out = set->members ? part : stored + set->start;
            ((bonds)set->function)(0, n, set->parameters, part, out);
            if (set->members) for (integer i = 0; i < n; i++) stored[set->members[i]] = part[i];
        }
        for (integer i = 0; i < entries; i++) part[i] = mass[i] * (v[i] * v[i]);
        total[k] = 0.5 * in_pairs(part, entries) + in_pairs(stored, all);
        if (!loads) continue;
        for (integer i = 0; i < entries; i++) part[i] = loads[i] * u[i];
        total[k] -= in_pairs(part, entries);
    }
    return 1;
}
