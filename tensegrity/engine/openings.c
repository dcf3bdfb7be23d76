/* Steps of a splitting, corrected where contacts open or close: `derivations.openings`.

   Behind `steps.c` and a scene's own overlaps(c, o, u, v, w, d), the overlap of each contact and
   its change in a step, and give(c, o, b, w, x, total, moment, turning), which hands impulse and
   moment to the two rows of a contact. */

#define SCAN 64

static real cubic(const real *p, real x) { return p[0] + x * (p[1] + x * (p[2] + x * p[3])); }
static real incline(const real *p, real x) { return p[1] + x * (2 * p[2] + x * 3 * p[3]); }

/* Where a cubic passes zero between two places on different sides of it. */
static real root_between(const real *p, real low, real high)
{
    const int below = cubic(p, low) > 0;
    real x = (low + high) / 2;
    for (int k = 0; k < 60; k++) {
        const real y = cubic(p, x), rate = incline(p, x);
        if ((y > 0) == below) low = x;
        else high = x;
        real next = rate != 0 ? x - y / rate : low;
        if (!(next > low && next < high)) next = (low + high) / 2;
        if (fabs(next - x) <= 1e-16) break;
        x = next;
    }
    return x;
}

/* The quadrature's error of a force (distance from the root)^alpha on one side of it. */
static void event(const scene *c, const openings *o, integer b, real w, const real *p, real x,
                  int opens)
{
    const integer row = o->row[b], width = o->degree + 1;
    const real alpha = o->exponents[row], *table = o->tables + 3 * row * width;
    const real rate = fabs(incline(p, x)), curvature = 2 * p[2] + 6 * p[3] * x;
    real sums[3] = {0};
    for (integer i = 0; i < o->kicks; i++) {
        real q = opens ? x - o->nodes[i] : o->nodes[i] - x;
        q -= floor(q);
        const real least = pow(q, alpha - 1), t = 2 * q - 1, weight = o->weights[i];
        real z[3] = {0};
        for (integer k = width - 1; k >= 0; k--)
            for (int j = 0; j < 3; j++) z[j] = z[j] * t + table[j * width + k];
        sums[0] += weight * (z[0] + least * q);
        sums[1] += weight * (z[1] + least * q * q);
        sums[2] += weight * o->offsets[i] * (z[2] + least);
    }
    const real size = o->strength[b] * pow(rate, alpha - 1), way = opens ? -1 : 1;
    const real total = -size * (rate * sums[0] + alpha * curvature * (sums[1] / 2 + sums[2]));
    const real moment = way * size * rate * sums[1];
    give(c, o, b, w, x, total, moment, -moment);
}

/* A contact that closed and opened again within the step: all its kicks are in there. */
static void touch(const scene *c, const openings *o, integer b, real w, const real *p, real one,
                  real other)
{
    const real alpha = o->exponents[o->row[b]], middle = (one + other) / 2;
    const real curvature = 2 * p[2] + 6 * p[3] * middle;
    real total = pow(fabs(curvature / 2), alpha) * pow(other - one, 2 * alpha + 1)
                 * o->betas[o->row[b]], moment = 0;
    for (integer i = 0; i < o->kicks; i++) {
        const real node = o->nodes[i], inside = cubic(p, node) + curvature * o->offsets[i];
        if (!(inside > 0 && node > 0 && node < 1)) continue;
        const real force = o->weights[i] * pow(inside, alpha);
        total -= force;
        moment += (node - middle) * force;
    }
    give(c, o, b, w, middle, o->strength[b] * total, o->strength[b] * moment, 0);
}

/* Whether contact b opened or closed in the step, and what that is corrected by. */
static int passed(const scene *c, const openings *o, integer b)
{
    const real w0 = o->before[b], w1 = o->after[b];
    const real d0 = o->rate_before[b], d1 = o->rate_after[b];
    const real p[4] = {w0, d0, 3 * (w1 - w0) - 2 * d0 - d1, 2 * (w0 - w1) + d0 + d1};
    if ((w0 > 0) != (w1 > 0)) {
        event(c, o, b, w1, p, root_between(p, 0, 1), w0 > 0);
        return 1;
    }
    const real rates[4] = {p[1], 2 * p[2], 3 * p[3], 0}, turn = root_between(rates, 0, 1);
    if ((cubic(p, turn) > 0) == (w0 > 0)) return 0;
    const real one = root_between(p, 0, turn), other = root_between(p, turn, 1);
    if (w0 > 0) {
        event(c, o, b, w1, p, one, 1);
        event(c, o, b, w1, p, other, 0);
    } else touch(c, o, b, w1, p, one, other);
    return 1;
}

/* The sign of an overlap changed, or it turned near zero; NaN, where nothing opens, is neither. */
static inline int suspect(real w0, real d0, real w1, real d1)
{
    const real near0 = fabs(w0), near1 = fabs(w1), least = near0 < near1 ? near0 : near1;
    return ((w0 > 0) != (w1 > 0))
           | ((w0 * d0 < 0) & (w1 * d1 > 0) & (4 * least < fabs(d0) + fabs(d1)));
}

static int all_passed(const scene *c, const openings *o)
{
    const real *restrict w0 = o->before, *restrict d0 = o->rate_before;
    const real *restrict w1 = o->after, *restrict d1 = o->rate_after;
    int found = 0, copied = 0;
    for (integer start = 0; start < o->count; start += SCAN) {
        const integer left = o->count - start, n = left < SCAN ? left : SCAN;
        int any = 0;
        for (integer i = start; i < start + n; i++) any |= suspect(w0[i], d0[i], w1[i], d1[i]);
        if (!any) continue;
        if (!copied) EACH(o->entries) o->was_u[i] = c->u[i], o->was_v[i] = c->v[i];
        copied = 1;
        for (integer i = start; i < start + n; i++)
            if (suspect(w0[i], d0[i], w1[i], d1[i])) found |= passed(c, o, i);
    }
    return found;
}

void advance_openings(const scene *c, openings *o, integer steps)
{
    const integer stages = c->stages;
    real *restrict u = c->u, *restrict v = c->v, *restrict a = o->a;
    acceleration(c, u, a);
    overlaps(c, o, u, v, o->before, o->rate_before);
    for (integer k = 0; k < steps; k++) {
        const real kick = c->kicks[0], drift = c->drifts[0], last = c->kicks[stages];
        real largest = 0;
        EACH(o->entries) {
            v[i] += kick * a[i];
            u[i] += drift * v[i];
        }
        if (o->travel) {
            for (integer i = 0; i < o->moving; i++) largest = larger(largest, fabs(drift * v[i]));
            *o->travel += largest;
        }
        for (integer s = 1; s < stages; s++) stage(c, c->kicks[s], c->drifts[s]);
        acceleration(c, u, a);
        EACH(o->entries) v[i] += last * a[i];
        overlaps(c, o, u, v, o->after, o->rate_after);
        if (all_passed(c, o)) {
            acceleration(c, u, a);
            overlaps(c, o, u, v, o->after, o->rate_after);
        }
        real *swap = o->before;
        o->before = o->after, o->after = swap;
        swap = o->rate_before;
        o->rate_before = o->rate_after, o->rate_after = swap;
    }
}
