typedef int function(const double **arg, double **res, long long *iw, double *w, int memory);

/* Results of a function at each of `count` places, (count, size).  Argument k is read at given[k],
   with the stride `steps[k]`: 0 where it is the same for all places. */
void map(function *f, long long count, long long size, long long arguments, const double **given,
         const long long *steps, double *results)
{
    for (long long place = 0; place < count; place++) {
        const double *arg[8];
        double *res[] = {results + place * size};
        for (long long k = 0; k < arguments; k++)
            arg[k] = given[k] + place * steps[k];
        f(arg, res, 0, 0, 0); /* CasADi's scalar code works in variables of its own */
    }
}
