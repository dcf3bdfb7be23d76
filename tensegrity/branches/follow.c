/* A branch from its start to its end: steps, their control, events.  It does what the functions
   of the same names in continuation.py and events.py do, which say why.

   A point is a row of SIZE numbers: z, tangent, values, residual, length, side, tests.  The
   tests are of the kinds of events, roots before folds. */
#include <math.h>
#include <string.h>

#define DATA (2 * M + VALUES)
#define SIZE (DATA + 3 + KINDS)
#define FIGURES 4 /* error, moved, last, cosine: before the residual in what `advance` gives */
#define MOST (FOLDS + (FOLDS + 1) * ROOTS + 1) /* events in a step */

typedef long long integer;
typedef double point[SIZE];
typedef int evaluate(const double **arg, double **res, integer *iw, double *w, int memory);

enum { RESIDUAL = DATA, LENGTH, SIDE, TESTS };
enum { ENDED, FULL, MANY, SHORT, NEEDED, REFUSED }; /* what `follow` returns */
enum { BEGIN, STEP, LOCATE };              /* what is to be done next */

typedef struct {
    const double *p, *settings; /* tolerance, residual, smallest, largest, turn */
    const integer *stop;        /* whether to end at each kind */
    evaluate **newton;          /* of each kind, 0 where it was not made yet */
    double *rows, *events, *before, *here, *signs;
    integer *kinds, *places;    /* of events; kind KINDS is a bifurcation */
    double step;
    integer points, room, events_room, count, found, next, kind, direction;
} branch;

static double dot(const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < M; i++)
        sum += a[i] * b[i];
    return sum;
}

static double apart(const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < M; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum);
}

static void call(evaluate *f, const double *x, const double *y, const double *z, double *out)
{
    const double *arg[] = {x, y, z};
    double *res[] = {out};
    f(arg, res, 0, 0, 0);
}

static void beyond(const branch *b, const double *before, const double *here, double length,
                   double step, double *made, double *figures)
{
    double given[4 * M + 2], out[SIZE + FIGURES];
    memcpy(given, before, 2 * M * sizeof(double));
    memcpy(given + 2 * M, here, 2 * M * sizeof(double));
    given[4 * M] = length;
    given[4 * M + 1] = step;
    call(tensegrity_advance, given, b->p, 0, out);
    memcpy(made, out, DATA * sizeof(double));
    memcpy(figures, out + DATA, FIGURES * sizeof(double));
    memcpy(made + DATA, out + DATA + FIGURES, (SIZE - DATA) * sizeof(double));
}

static void at(const branch *b, const double *z, const double *tangent, double *made)
{
    double before[2 * M], here[2 * M], figures[FIGURES];
    for (int i = 0; i < M; i++) {
        before[i] = z[i] - tangent[i];
        here[i] = z[i];
        before[M + i] = here[M + i] = tangent[i];
    }
    beyond(b, before, here, 1, 0, made, figures);
}

static void exactly_at(const branch *b, const double *z, const double *tangent, double *made)
{
    double out[M + VALUES];
    at(b, z, tangent, made);
    call(tensegrity_values, z, b->p, 0, out);
    memcpy(made, z, M * sizeof(double));
    memcpy(made + 2 * M, out + M, VALUES * sizeof(double));
}

static int polish(const branch *b, int kind, double *z, const double *tangent)
{
    int fold = kind >= ROOTS, n = fold ? 2 * M : M;
    double x[2 * M], new[2 * M + 1], previous = INFINITY;
    memcpy(x, z, M * sizeof(double));
    memcpy(x + M, tangent, M * sizeof(double));
    for (int k = 0; k < POLISH; k++) {
        call(b->newton[kind], x, fold ? tangent : b->p, b->p, new);
        double moved = new[n];
        if (!isfinite(moved))
            return 0;
        memcpy(x, new, n * sizeof(double));
        if (moved <= 1e-15 || (moved < 1e-11 && moved >= previous / 4)) {
            memcpy(z, x, M * sizeof(double));
            return 1;
        }
        previous = moved;
    }
    return 0;
}

static void between(const double *before, const double *here, double length, double u, double *z,
                    double *tangent)
{
    double w = 1 - u, rise = length * u * w, norm = 0;
    for (int i = 0; i < M; i++) {
        z[i] = w * w * (1 + 2 * u) * before[i] + rise * w * before[M + i]
               + u * u * (1 + 2 * w) * here[i] - rise * u * here[M + i];
        tangent[i] = w * before[M + i] + u * here[M + i];
        norm += tangent[i] * tangent[i];
    }
    for (int i = 0; i < M; i++)
        tangent[i] /= sqrt(norm);
}

/* Whether a point is next to the curve between two others: else it is on another branch.  Where
   branches meet it gets the tangent of the curve, for its own is round-off. */
static int on_curve(double *z, const double *before, const double *here, double length)
{
    double chord[M], moved[M], guess[M], tangent[M];
    for (int i = 0; i < M; i++) {
        chord[i] = here[i] - before[i];
        moved[i] = z[i] - before[i];
    }
    double square = dot(chord, chord);
    between(before, here, length, dot(moved, chord) / (square + TINY), guess, tangent);
    for (int i = 0; i < M; i++)
        moved[i] = z[i] - guess[i];
    double along = dot(moved, tangent), away = 0;
    for (int i = 0; i < M; i++)
        away += (moved[i] - along * tangent[i]) * (moved[i] - along * tangent[i]);
    if (dot(z + M, tangent) < ALIGNED)
        memcpy(z + M, tangent, M * sizeof(double));
    return sqrt(away) <= NEAR * sqrt(square) + NEAR * NEAR;
}

static void locate(const branch *b, const double *before, const double *here, double length,
                   int kind, double sign, double *made)
{
    double low = 0, high = 1, at_low = before[TESTS + kind], at_high = here[TESTS + kind];
    double z_low[M], z_high[M], z[M], tangent[M];
    if (at_low == 0)
        at_low = sign * ROOT_AT_START;
    memcpy(z_low, before, sizeof z_low);
    memcpy(z_high, here, sizeof z_high);
    for (int k = 0; k < BISECTIONS; k++) {
        between(before, here, length, low + (high - low) * at_low / (at_low - at_high), z, tangent);
        double near = apart(z_high, z_low) + 1e-12;
        if (polish(b, kind, z, tangent) && apart(z, z_low) <= near && apart(z, z_high) <= near) {
            exactly_at(b, z, tangent, made);
            if (on_curve(made, before, here, length))
                return;
        }
        double middle = (low + high) / 2;
        between(before, here, length, middle, z, tangent);
        at(b, z, tangent, made);
        if (made[TESTS + kind] * sign > 0) {
            low = middle;
            at_low = made[TESTS + kind];
            memcpy(z_low, made, sizeof z_low);
        } else {
            high = middle;
            at_high = made[TESTS + kind];
            memcpy(z_high, made, sizeof z_high);
        }
    }
    on_curve(made, before, here, length);
}

static void bifurcation(const branch *b, double *made)
{
    double low = 0, high = 1, z[M], tangent[M];
    for (int k = 0; k < BISECTIONS; k++) {
        double middle = (low + high) / 2;
        between(b->before, b->here, b->here[LENGTH], middle, z, tangent);
        at(b, z, tangent, made);
        if (made[SIDE] * b->before[SIDE] > 0)
            low = middle;
        else
            high = middle;
    }
}

/* Passed events of kinds from `first` to `last`, behind those in `made`; -1 - kind where its
   Newton step is missing. */
static int passed(const branch *b, const double *start, const double *end, double length,
                  const double *signs, int first, int last, point *made, int *kinds, int found)
{
    for (int kind = first; kind < last; kind++)
        if (signs[kind] * end[TESTS + kind] < 0) {
            if (!b->newton[kind])
                return -1 - kind;
            locate(b, start, end, length, kind, signs[kind], made[found]);
            kinds[found++] = kind;
        }
    return found;
}

static double place(const branch *b, const double *z)
{
    double sum = 0;
    for (int i = 0; i < M; i++)
        sum += (z[i] - b->before[i]) * b->before[M + i];
    return sum;
}

static void sort(const branch *b, point *made, int *kinds, int found)
{
    for (int k = 1; k < found; k++)
        for (int i = k; i && place(b, made[i]) < place(b, made[i - 1]); i--) {
            point other;
            int kind = kinds[i];
            memcpy(other, made[i], sizeof other);
            memcpy(made[i], made[i - 1], sizeof other);
            memcpy(made[i - 1], other, sizeof other);
            kinds[i] = kinds[i - 1];
            kinds[i - 1] = kind;
        }
}

static void renew(double *signs, const double *end)
{
    for (int kind = 0; kind < KINDS; kind++)
        if (end[TESTS + kind] != 0)
            signs[kind] = end[TESTS + kind];
}

/* Events between `before` and `here`, in their order; how many, or as `passed` where negative. */
static int located(const branch *b, point *made, int *kinds)
{
    int quiet = b->before[SIDE] * b->here[SIDE] > 0;
    for (int kind = 0; kind < KINDS; kind++)
        quiet &= !(b->signs[kind] * b->here[TESTS + kind] < 0);
    if (quiet)
        return 0;
    int folds = passed(b, b->before, b->here, b->here[LENGTH], b->signs, ROOTS, KINDS, made, kinds, 0);
    if (folds < 0)
        return folds;
    sort(b, made, kinds, folds);
    double signs[KINDS + 1];
    memcpy(signs, b->signs, KINDS * sizeof(double));
    const double *start = b->before;
    int found = folds;
    for (int k = 0; k <= folds; k++) {
        const double *end = k < folds ? made[k] : b->here;
        double length = folds ? apart(end, start) : b->here[LENGTH];
        found = passed(b, start, end, length, signs, 0, ROOTS, made, kinds, found);
        if (found < 0)
            return found;
        renew(signs, end);
        start = end;
    }
    if (b->before[SIDE] * b->here[SIDE] < 0) {
        kinds[found] = KINDS;
        bifurcation(b, made[found++]);
    }
    sort(b, made, kinds, found);
    for (int k = 0; k < found; k++)
        made[k][LENGTH] = apart(made[k], b->before);
    return found;
}

static void keep(branch *b, const double *made, integer kind, integer row)
{
    memcpy(b->events + SIZE * b->found, made, sizeof(point));
    b->kinds[b->found] = kind;
    b->places[b->found++] = row;
}

static void leave_start(branch *b)
{
    const double *start = b->rows;
    double from[2 * M], figures[FIGURES];
    point back;
    for (int i = 0; i < M; i++) {
        from[i] = start[i] - start[M + i];
        from[M + i] = start[M + i];
    }
    beyond(b, from, start, 1, -b->here[LENGTH], back, figures);
    for (int kind = 0; kind < KINDS; kind++) {
        double test = start[TESTS + kind], here = b->here[TESTS + kind];
        b->signs[kind] = test;
        if (fabs(test) <= (kind < ROOTS ? ROOT_AT_START : FOLD_AT_START)) {
            b->signs[kind] = here;
            if (kind < ROOTS || back[TESTS + kind] * here < 0)
                keep(b, start, kind, 0);
        }
    }
}

static int next_point(branch *b)
{
    double tolerance = b->settings[0], residual = b->settings[1], smallest = b->settings[2];
    double largest = b->settings[3], turn = b->settings[4], figures[FIGURES];
    point made;
    while (b->step >= smallest) {
        beyond(b, b->before, b->here, b->here[LENGTH], b->step, made, figures);
        double error = figures[0], moved = figures[1], last = figures[2], cosine = figures[3];
        double turned = cosine > 0 ? acos(cosine < 1 ? cosine : 1) : INFINITY;
        double wanted = 0.9 * pow(tolerance / (error + TINY), 0.25);
        double by_turn = 0.8 * turn / (turned + TINY);
        wanted = by_turn < wanted ? by_turn : wanted;
        if (made[RESIDUAL] <= residual && last <= SETTLED && moved <= b->step / 2 && turned <= turn
            && error <= tolerance && (made[SIDE] * b->here[SIDE] > 0 || b->step <= TWINS)) {
            double factor = wanted > 0.3 ? wanted : 0.3, next = b->step * (factor < 2 ? factor : 2);
            b->step = next < largest ? next : largest;
            memcpy(b->before, b->here, sizeof made);
            memcpy(b->here, made, sizeof made);
            return 1;
        }
        double factor = wanted > 0.1 ? wanted : 0.1;
        b->step *= wanted != wanted ? 0.5 : factor < 0.5 ? factor : 0.5;
    }
    return 0;
}

/* Least-norm Newton step to g = 0 and the unit vector along the branch, from the QR factors of
   the transposed Jacobian, whose columns are `rows`; 0 where its rank is in doubt. */
static int least_norm(double rows[M - 1][M], const double *g, double *move, double *along)
{
    double q[M][M], scale[M], share[M], largest = 0; /* mirrors I - q share q', diagonal in scale */
    for (int k = 0; k < M - 1; k++) {
        double square = 0;
        for (int i = k; i < M; i++)
            square += rows[k][i] * rows[k][i];
        scale[k] = rows[k][k] > 0 ? -sqrt(square) : sqrt(square);
        largest = fabs(scale[k]) > largest ? fabs(scale[k]) : largest;
        for (int i = 0; i < M; i++)
            q[k][i] = i < k ? 0 : rows[k][i] - (i == k) * scale[k];
        share[k] = 2 / (square - rows[k][k] * rows[k][k] + q[k][k] * q[k][k] + TINY);
        for (int j = k + 1; j < M - 1; j++) {
            double product = share[k] * dot(q[k], rows[j]);
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
        double of_move = share[k] * dot(q[k], move), of_along = share[k] * dot(q[k], along);
        for (int i = k; i < M; i++) {
            move[i] -= of_move * q[k][i];
            along[i] -= of_along * q[k][i];
        }
    }
    return 1;
}

/* The first point, from what is in `here`; 0 where that has to be looked at more closely. */
static int begin(branch *b)
{
    double z[M], move[M], along[M], out[M * M], rows[M - 1][M];
    memcpy(z, b->here, sizeof z);
    for (int k = 0; k < START_ITERATIONS; k++) {
        int settled = 1;
        call(tensegrity_linear, z, b->p, 0, out);
        for (int i = 0; i < M - 1; i++)
            for (int j = 0; j < M; j++)
                rows[i][j] = out[M - 1 + (M - 1) * j + i];
        if (!least_norm(rows, out, move, along))
            return 0;
        for (int i = 0; i < M; i++) {
            z[i] -= move[i];
            settled &= fabs(move[i]) <= 1e-15 * (1 + fabs(z[i]));
        }
        if (settled)
            break;
    }
    double lead = along[M - 1];
    if (!(fabs(lead) > 1e-8)) {
        lead = 0;
        for (int i = 0; i < M; i++)
            lead = fabs(along[i]) > fabs(lead) ? along[i] : lead;
    }
    for (int i = 0; i < M; i++)
        along[i] = lead * b->direction > 0 ? along[i] : -along[i];
    at(b, z, along, b->here);
    if (!(b->here[RESIDUAL] <= b->settings[1]))
        return 0;
    memcpy(b->rows, b->here, sizeof(point));
    memcpy(b->signs, b->here + TESTS, KINDS * sizeof(double));
    memcpy(b->before, b->here, sizeof(point));
    for (int i = 0; i < M; i++)
        b->before[i] = b->here[i] - b->step * b->here[M + i];
    b->here[LENGTH] = b->step;
    b->count = 1;
    b->next = STEP;
    return 1;
}

/* Go on until the branch ends, or something is missing: then it may be called again. */
int follow(branch *b)
{
    point made[MOST];
    int kinds[MOST];
    if (b->next == BEGIN && !begin(b))
        return REFUSED;
    for (;;) {
        if (b->next == STEP) {
            if (b->count >= b->points)
                return MANY;
            if (b->count + 1 >= b->room || b->found + KINDS + MOST > b->events_room)
                return FULL;
            if (!next_point(b))
                return SHORT;
            if (b->count == 1)
                leave_start(b);
            b->next = LOCATE;
        }
        int found = located(b, made, kinds);
        if (found < 0) {
            b->kind = -1 - found;
            return NEEDED;
        }
        for (int k = 0; k < found; k++) {
            int stops = kinds[k] < KINDS && b->stop[kinds[k]];
            keep(b, made[k], kinds[k], b->count - !stops);
            if (stops) {
                memcpy(b->rows + SIZE * b->count++, made[k], sizeof(point));
                b->kind = kinds[k];
                return ENDED;
            }
        }
        memcpy(b->rows + SIZE * b->count++, b->here, sizeof(point));
        renew(b->signs, b->here);
        b->next = STEP;
    }
}
