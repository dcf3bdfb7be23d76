/* The compiled loop of arc-length continuation: steps until one contains an event, and the location
   of events.  It calls the functions that CasADi generates in steppers.py; the layout of a
   row is described in arclength.py. */
#include <math.h>
#include <string.h>

#define SIZE (TESTS + KINDS)

typedef long long integer;
typedef int evaluate(const double **arg, double **res, integer *iw, double *w, int memory);

enum { LENGTH = 2 * M + VALUES + 1, SIDE, TESTS };

static void call(evaluate *f, double *out, const double *a, const double *b, const double *c,
                 const double *d)
{
    const double *arg[] = {a, b, c, d};
    double *res[] = {out};
    f(arg, res, 0, 0, 0);
}

static double dot(const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < M; i++)
        sum += a[i] * b[i];
    return sum;
}

/* Least-norm Newton step to g = 0 and the unit tangent of the branch, by QR factorisation of the
   transposed Jacobian, whose columns are `rows`; returns 0 if its rank is doubtful. */
int least_norm(const double *p, const double *z, double *move)
{
    double g[M * M], rows[M - 1][M], *along = move + M;
    double q[M][M], scale[M], factor[M], largest = 0; /* reflections I - q factor q' */
    call(tensegrity_linear, g, z, p, 0, 0);
    for (int i = 0; i < M - 1; i++)
        for (int j = 0; j < M; j++)
            rows[i][j] = g[M - 1 + (M - 1) * j + i];
    for (int k = 0; k < M - 1; k++) {
        double square = 0;
        for (int i = k; i < M; i++)
            square += rows[k][i] * rows[k][i];
        scale[k] = rows[k][k] > 0 ? -sqrt(square) : sqrt(square);
        largest = fabs(scale[k]) > largest ? fabs(scale[k]) : largest;
        for (int i = 0; i < M; i++)
            q[k][i] = i < k ? 0 : rows[k][i] - (i == k) * scale[k];
        factor[k] = 2 / (square - rows[k][k] * rows[k][k] + q[k][k] * q[k][k] + TINY);
        for (int j = k + 1; j < M - 1; j++) {
            double product = factor[k] * dot(q[k], rows[j]);
            for (int i = k; i < M; i++)
                rows[j][i] -= product * q[k][i];
        }
    }
    for (int k = 0; k < M - 1; k++) {
        if (!(fabs(scale[k]) > FULL_RANK * largest))
            return 0;
        double left = g[k];
        for (int j = 0; j < k; j++)
            left -= rows[k][j] * move[j];
        move[k] = left / scale[k];
    }
    move[M - 1] = 0;
    for (int i = 0; i < M; i++)
        along[i] = i == M - 1;
    for (int k = M - 2; k >= 0; k--) {
        double of_move = factor[k] * dot(q[k], move), of_along = factor[k] * dot(q[k], along);
        for (int i = k; i < M; i++) {
            move[i] -= of_move * q[k][i];
            along[i] -= of_along * q[k][i];
        }
    }
    return 1;
}

/* A fictitious point before the first one, for which the cubic predictor is the tangent. */
static const double *preceding(const double *here, double *before)
{
    for (int i = 0; i < M; i++) {
        before[i] = here[i] - here[LENGTH] * here[M + i];
        before[M + i] = here[M + i];
    }
    return before;
}

/* See ArclengthStepper.steps. */
int steps(const double *p, double *control, double *rows, integer count, integer room,
          const integer *places, const double *values, integer levels)
{
    while (count < room) {
        double *here = rows + SIZE * (count - 1), *row = here + SIZE;
        double first[SIZE], out[SIZE + 2];
        const double *before = count > 1 ? here - SIZE : preceding(here, first);
        do {
            if (!(control[0] >= control[5]))
                return count;
            call(tensegrity_advance, out, before, here, control, p);
            control[0] = out[SIZE + 1];
        } while (!out[SIZE]);
        memcpy(row, out, SIZE * sizeof(double));
        count++;
        int quiet = here[SIDE] * row[SIDE] > 0;
        for (int kind = TESTS; kind < SIZE; kind++) {
            if (row[kind] == 0)
                row[kind] = ROOT_AT_START * here[kind];
            quiet &= !(here[kind] * row[kind] < 0);
        }
        for (int k = 0; k < levels; k++)
            quiet &= (here[places[k]] - values[k]) * (row[places[k]] - values[k]) > 0;
        if (!quiet)
            break;
    }
    return count;
}

/* See ArclengthStepper.corrected. */
void corrected(const double *p, const double *z, const double *tangent, double *row)
{
    double before[SIZE], here[SIZE] = {0}, control[6] = {0}, out[SIZE + 2];
    memcpy(here, z, M * sizeof(double));
    memcpy(here + M, tangent, M * sizeof(double));
    here[LENGTH] = 1;
    call(tensegrity_advance, out, preceding(here, before), here, control, p);
    memcpy(row, out, SIZE * sizeof(double));
}

/* The point at a fraction of the way between two others, and the distance of an entry of its row
   from a value. */
static double away(const double *p, const double *before, const double *here, double part,
                   integer place, double value, double *row)
{
    double curve[2 * M];
    call(tensegrity_interpolated, curve, before, here, &part, 0);
    corrected(p, curve, curve + M, row);
    return row[place] - value;
}

/* See ArclengthStepper.locate: Chandrupatla's method, as in root.py. */
void locate(const double *p, const double *before, const double *here, integer place, double value,
            double low, double high, double *row)
{
    double a = 0, at_a = low, b = 1, at_b = high, c = a, at_c = at_a, part = low / (low - high);
    double found[2 + M], noise = ROUND_OFF / 2 * fmax(fabs(low), fabs(high));
    for (int k = 0; k < BISECTIONS; k++) {
        double best = fabs(at_a) < fabs(at_b) ? a : b;
        double least = 2 * ROUND_OFF * best / fabs(b - a);
        if (fmin(fabs(at_a), fabs(at_b)) <= noise || least > 0.5)
            break;
        double x = a + fmin(fmax(part, least), 1 - least) * (b - a);
        if (x == a || x == b)
            break;
        double at_x = away(p, before, here, x, place, value, row);
        if ((at_x > 0) == (at_a > 0)) {
            c = a, at_c = at_a;
        } else {
            c = b, at_c = at_b, b = a, at_b = at_a;
        }
        a = x, at_a = at_x, part = 0.5;
        double s = (a - b) / (c - b), height = (at_a - at_b) / (at_c - at_b);
        if (height * height < s && (1 - height) * (1 - height) < 1 - s) {
            part = at_a / (at_b - at_a) * at_c / (at_b - at_c);
            part += (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b);
        }
    }
    if (a == 0 || fabs(at_b) < fabs(at_a)) /* else the row is that of a */
        away(p, before, here, fabs(at_a) < fabs(at_b) ? a : b, place, value, row);
    call(tensegrity_deviation, found, row, before, here, 0);
    if (found[1] < ALIGNED)
        memcpy(row + M, found + 2, M * sizeof(double));
}
