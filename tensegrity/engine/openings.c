/* Steps of a splitting, corrected at the loss and gain of contacts: `derivations.openings`.

   Included after `steps.c` and `overlaps.c`, which defines: overlaps(c, o, u, v, w, d), the
   overlap of each contact and its change in a step; renew_overlaps(c, o, since, w, d), those after
   a step, which are w and d where nothing moved from stage `since` on; next_stage(c), the number of
   the next one; may_pass(c, o), whether any overlap can have passed zero, by the elongation ranges;
   keep_end(c, o), which stores the motion at the end of a step; mobility(c, o, b, x), the change of
   an overlap's rate by a unit impulse of its contact; swing(c, o, b, x), the curvature of an overlap
   by the rotation of its line; apply_impulse(c, o, b, w, x, total, moment, turning), which applies
   impulse and moment to the two rows of a contact. */

#define SCAN 64

/* For blocks of n contacts that may move, the first of each number `start`. */
#define BLOCKS_OF_CONTACTS(c, o, start, n)                                                  \
    for (integer row = 0, some = moving(c, (o)->bonds); row < (o)->count; row += (o)->bonds) \
        for (integer start = row, n = some < SCAN ? some : SCAN; n > 0;                      \
             start += n, n = row + some - start < SCAN ? row + some - start : SCAN)

#define ABREAST 16 /* kicks summed in SIMD registers */
#define NEAR 1.0
#define SERIES 24
#define ROUNDS 4

/* x^exponent of x >= 0; the slope of Hertz's law, the most frequent one, is a square root. */
static inline real raised(real x, real exponent)
{
    return exponent == 0.5 ? sqrt(x) : pow(x, exponent);
}

/* Sums over the kicks of all steps, as sums of zeta functions over the kicks of one step. */
static void zetas(const openings *o, integer row, real x, int opens, real *sums)
{
    const integer width = o->degree + 1;
    const real *table = o->tables + 3 * row * width;
    for (integer start = 0; start < o->kicks; start += ABREAST) {
        real q[ABREAST], t[ABREAST], least[ABREAST], a[ABREAST], b[ABREAST], c[ABREAST];
        real weight[ABREAST] = {0}, offset[ABREAST] = {0}, node[ABREAST] = {0};
        for (integer i = start; i < o->kicks && i < start + ABREAST; i++)
            node[i - start] = o->nodes[i], weight[i - start] = o->weights[i],
                         offset[i - start] = o->offsets[i];
        EACH(ABREAST) {
            const real y = opens ? x - node[i] : node[i] - x;
            q[i] = y - floor(y), t[i] = 2 * q[i] - 1;
            a[i] = b[i] = c[i] = 0;
        }
        for (integer k = width - 1; k >= 0; k--) {
            const real *at = table + k;
            EACH(ABREAST) {
                a[i] = a[i] * t[i] + at[0];
                b[i] = b[i] * t[i] + at[width];
                c[i] = c[i] * t[i] + at[2 * width];
            }
        }
        if (o->exponents[row] == 1.5) EACH(ABREAST) least[i] = sqrt(q[i]);
        else EACH(ABREAST) least[i] = pow(q[i], o->exponents[row] - 1);
        for (integer i = 0; i < ABREAST; i++) {
            sums[0] += weight[i] * (a[i] + least[i] * q[i]);
            sums[1] += weight[i] * (b[i] + least[i] * q[i] * q[i]);
            sums[2] += weight[i] * offset[i] * (c[i] + least[i]);
        }
    }
}

/* How an overlap passes zero at a place x of a step: its rate, its curvature, and the curvature by
   kicks alone. */
typedef struct { real rate, curvature, pull; } crossing;

static crossing crossing_at(const scene *c, const openings *o, integer b, const real *p, real x)
{
    const real curvature = 2 * p[2] + 6 * p[3] * x;
    return (crossing){fabs(incline(p, x)), curvature, curvature - swing(c, o, b, x)};
}

/* The negative of the quadrature error of a force (distance from the root)^alpha on one side of it,
   over the strength of the contact. */
static real exterior_error(const openings *o, integer b, crossing at, real x, int opens,
                           real *moment)
{
    const real alpha = o->exponents[o->row[KINK(b)]], size = raised(at.rate, alpha - 1);
    real sums[3] = {0};
    zetas(o, o->row[KINK(b)], x, opens, sums);
    *moment = (opens ? -1 : 1) * size * at.rate * sums[1];
    return -size * (at.rate * sums[0] + alpha * (at.curvature * sums[1] / 2 + at.pull * sums[2]));
}

/* The part of that error due to the kicks of one step, which begins `start` steps after the
   beginning of this one: of a force up to an event at x, or from there on, also for x outside
   the step. */
static real between(const openings *o, integer b, crossing at, real x, int opens, real start,
                    real *moment)
{
    const real alpha = o->exponents[o->row[KINK(b)]], size = at.rate * raised(at.rate, alpha - 1);
    const real bend = alpha * at.curvature / (2 * at.rate), lead = alpha * at.pull / at.rate;
    const real far = opens ? x - start : 1 + start - x, ends[2] = {far, far > 1 ? far - 1 : 0};
    real sum = 0, first = 0;
    for (int k = 0; k < 2; k++) {
        const real y = ends[k], power = (k ? 1 : -1) * y * y * raised(y, alpha - 1);
        sum += power * (1 / (alpha + 1) + bend * y / (alpha + 2));
        first += power * y / (alpha + 2);
    }
    for (integer i = 0; i < o->kicks; i++) {
        const real away = opens ? x - start - o->nodes[i] : start + o->nodes[i] - x;
        if (!(away > 0 && away <= far)) continue;
        const real part = o->weights[i] * raised(away, alpha - 1);
        sum += part * (away + bend * away * away + lead * o->offsets[i]);
        first += part * away * away;
    }
    *moment = (opens ? -1 : 1) * size * first;
    return size * sum;
}

static void event(const scene *c, const openings *o, integer b, real w, const real *p, real x,
                  int opens)
{
    real moment, before;
    const crossing at = crossing_at(c, o, b, p, x);
    const int own = at.rate > 0 && (o->alone || (opens && o->begins)); /* no kicks of other steps */
    real total = own ? -between(o, b, at, x, opens, 0, &moment)
                     : exterior_error(o, b, at, x, opens, &moment);
    if (!own && x < 0 && at.rate > 0) { /* there are no kicks before a run begins */
        total += between(o, b, at, x, opens, -1, &before);
        moment -= before;
    }
    const real strength = o->strength[KINK(b)];
    apply_impulse(c, o, b, w, x, strength * total, strength * moment, -strength * moment);
}

/* A contact that closes and opens again within the step, which contains all its kicks. */
static void touch(const scene *c, const openings *o, integer b, real w, const real *p, real one,
                  real other)
{
    const real alpha = o->exponents[o->row[KINK(b)]], middle = (one + other) / 2;
    const real curvature = 2 * p[2] + 6 * p[3] * middle, pull = curvature - swing(c, o, b, middle);
    real total = pow(fabs(curvature / 2), alpha) * pow(other - one, 2 * alpha + 1)
                 * o->betas[o->row[KINK(b)]], moment = 0;
    for (integer i = 0; i < o->kicks; i++) {
        const real node = o->nodes[i], inside = cubic(p, node) + pull * o->offsets[i];
        if (!(inside > 0 && node > 0 && node < 1)) continue;
        const real force = o->weights[i] * inside * raised(inside, alpha - 1);
        total -= force;
        moment += (node - middle) * force;
    }
    const real strength = o->strength[KINK(b)];
    apply_impulse(c, o, b, w, middle, strength * total, strength * moment, 0);
}

/* Whether an overlap that returned to its side passed zero, and had the other sign at a kick;
   events between two kicks are left uncorrected, as in a step without corrections. */
static int is_felt(const scene *c, const openings *o, integer b, const real *p, real turn,
                   int closed)
{
    const real pull = 2 * p[2] + 6 * p[3] * turn - swing(c, o, b, turn);
    int felt = 0;
    for (integer i = 0; i < o->kicks; i++)
        felt |= (cubic(p, o->nodes[i]) + pull * o->offsets[i] > 0) != closed;
    return felt && (cubic(p, turn) > 0) != closed;
}

/* The cubic through an overlap and its rate at the beginning and the end of the step. */
static void path_of(const openings *o, integer b, real *p)
{
    const real w0 = o->before[b], w1 = o->after[b];
    p[0] = w0, p[1] = o->rate_before[b];
    p[2] = 3 * (w1 - w0) - 2 * p[1] - o->rate_after[b];
    p[3] = 2 * (w0 - w1) + p[1] + o->rate_after[b];
}

/* An event up to NEAR steps before a single or first step, or after a single step, with contact
   between the step and the event. */
static void event_outside(const scene *c, const openings *o, integer b, int behind)
{
    real p[4];
    path_of(o, b, p);
    const real from = behind, to = behind ? 1 + NEAR : -NEAR;
    if (!(cubic(p, from) > 0 && cubic(p, to) < 0)) return;
    const real x = behind ? root_between(p, from, to) : root_between(p, to, from);
    event(c, o, b, o->after[b], p, x, behind);
}

/* Sums over the kicks of a step of the positive overlap, and of that times the remaining time,
   for a linear contact of stiffness `own` with other forces g + slope t and the rotation of its
   line. */
static void kicked(const openings *o, real own, real w, real rate, real g, real slope, real turn,
                   real *sums)
{
    sums[0] = sums[1] = 0;
    for (integer i = 0; i < o->kicks; i++) {
        const real at = o->nodes[i], inside = w + turn * at * at / 2;
        const real part = inside > 0 ? o->weights[i] * inside : 0;
        sums[0] += part, sums[1] += part * (1 - at);
        rate += o->weights[i] * (g + slope * at) - own * part;
        if (i + 1 < o->kicks) w += (o->nodes[i + 1] - at) * rate;
    }
}

/* The same integrals of the motion itself, for a time `far` after it closes. */
static void moved(real own, real rate, real g, real slope, real far, real *sums)
{
    real terms[SERIES] = {0, rate * far, g * far * far / 2};
    sums[0] = sums[1] = 0;
    for (int k = 1; k < SERIES; k++) {
        if (k > 2) terms[k] = -own * far * far * terms[k - 2] / (k * (k - 1));
        if (k == 3) terms[k] += slope * far * far * far / 6;
        sums[0] += far * terms[k] / (k + 1), sums[1] += far * far * terms[k] / ((k + 1) * (k + 2));
    }
}

/* A contact of exponent 1 that opens or closes: its kicks and its motion are those of a linear
   spring with other forces that vary linearly, which follow from both ends of the step. */
static void linear(const scene *c, const openings *o, integer b, const real *p)
{
    const real w0 = o->before[b], w1 = o->after[b], d0 = p[1], d1 = o->rate_after[b];
    const int opens = w0 > 0;
    real x = root_between(p, 0, 1), path[4], kicks[2] = {0, 0}, motion[2], g = 0, slope = 0;
    const real turn = swing(c, o, b, x), strength = o->strength[KINK(b)];
    const real own = *o->dt * *o->dt * strength * mobility(c, o, b, x);
    for (int k = 0; k < ROUNDS; k++) {
        const real way = w1 - w0 - d0 - turn / 2 + own * kicks[1];
        const real change = d1 - d0 - turn + own * kicks[0];
        slope = 6 * (change - 2 * way), g = change - slope / 2;
        kicked(o, own, w0, d0, g, slope, turn, kicks);
    }
    real end = w1, end_rate = d1;
    for (int k = 0; k < (opens ? ROUNDS : 1); k++) { /* from the open end, backwards if it opens */
        const real there = opens ? g + turn + slope : g + turn, grows = opens ? -slope : slope;
        path[0] = opens ? end : w0, path[1] = opens ? -end_rate : d0;
        path[2] = there / 2, path[3] = grows / 6;
        if (!(path[0] <= 0 && cubic(path, 1) > 0)) return;
        x = root_between(path, 0, 1);
        moved(own, incline(path, x), there + grows * x, grows, 1 - x, motion);
        if (!opens) break;
        const real w = w0 - cubic(path, 1) + own * motion[1];
        const real rate = d0 + incline(path, 1) - own * motion[0];
        end += w + rate, end_rate += rate;
    }
    if (opens) x = 1 - x, motion[1] = motion[0] - motion[1];
    const real total = strength * (motion[0] - kicks[0]);
    const real moment = strength * (motion[1] - kicks[1]) - (1 - x) * total;
    apply_impulse(c, o, b, w1, x, total, moment, -moment);
}

/* Correct a step in which contact b opened or closed. */
static void pass(const scene *c, const openings *o, integer b)
{
    const real w0 = o->before[b], w1 = o->after[b];
    real p[4];
    path_of(o, b, p);
    if ((w0 > 0) != (w1 > 0)) {
        if (o->exponents[o->row[KINK(b)]] == 1) linear(c, o, b, p);
        else event(c, o, b, w1, p, root_between(p, 0, 1), w0 > 0);
        return;
    }
    const real rates[4] = {p[1], 2 * p[2], 3 * p[3], 0}, turn = root_between(rates, 0, 1);
    if (!is_felt(c, o, b, p, turn, w0 > 0)) return;
    const real one = root_between(p, 0, turn), other = root_between(p, turn, 1);
    if (w0 > 0) {
        event(c, o, b, w1, p, one, 1);
        event(c, o, b, w1, p, other, 0);
    } else touch(c, o, b, w1, p, one, other);
}

/* Whether the sign of an overlap changed, or it has an extremum near zero; not for NaN, the
   place of a missing kink.  Integers as wide as the numbers and no branches: the scan is
   vectorised. */
static inline integer suspect(real w0, real d0, real w1, real d1)
{
    const real near0 = fabs(w0), near1 = fabs(w1), least = near0 < near1 ? near0 : near1;
    const integer crossed = (w0 > 0) ^ (w1 > 0), turned = (w0 * d0 < 0) & (w1 * d1 > 0);
    return crossed | (turned & (4 * least < fabs(d0) + fabs(d1)));
}

static void pass_all(const scene *c, openings *o)
{
    const real *restrict w0 = o->before, *restrict d0 = o->rate_before;
    const real *restrict w1 = o->after, *restrict d1 = o->rate_after;
    int met = 0;
    BLOCKS_OF_CONTACTS(c, o, start, n) {
        integer any = o->alone | o->begins;
        EACH(n) any |= suspect(w0[start + i], d0[start + i], w1[start + i], d1[start + i]);
        if (!any) continue;
        if (!met) keep_end(c, o);
        met = 1;
        for (integer i = start; i < start + n; i++)
            if (suspect(w0[i], d0[i], w1[i], d1[i])) pass(c, o, i);
        for (integer i = start; i < start + n && (o->alone | o->begins); i++)
            for (int behind = 0; behind <= (o->alone != 0); behind++)
                event_outside(c, o, i, behind);
    }
    if (met) renew_overlaps(c, o, next_stage(c) + 1, o->after, o->rate_after);
}

/* Overlaps are computed only once the elongation ranges show that a contact may have changed. */
integer advance_openings(const scene *c, openings *o, integer steps, integer opened)
{
    FLUSH
    o->begins = !opened;
    int looking = 0;
    CLOSE_RING(c, c->u, c->v)
    for (integer k = 0; k < steps; k++) {
        const integer begun = next_stage(c);
        if (!looking) EACH(moving(c, o->entries)) o->u[i] = c->u[i], o->v[i] = c->v[i];
        for (integer s = 0; s < c->stages; s++) stage(c, c->kicks[s], c->drifts[s]);
        if (c->closing) stage(c, c->kicks[c->stages], 0);
        if (!looking) {
            if (!o->alone && !o->begins && !may_pass(c, o)) {
                NARROW(c)
                continue;
            }
            overlaps(c, o, o->u, o->v, o->before, o->rate_before);
            looking = 1;
        }
        renew_overlaps(c, o, begun, o->before, o->rate_before);
        pass_all(c, o);
        o->begins = 0;
        real *swap = o->before;
        o->before = o->after, o->after = swap;
        swap = o->rate_before;
        o->rate_before = o->rate_after, o->rate_after = swap;
        const integer known = moving(c, o->bonds);
        NARROW(c)
        const integer now = moving(c, o->bonds);
        if (now > known) { /* bonds that have not moved so far */
            overlaps(c, o, c->u, c->v, o->before, o->rate_before);
            for (integer row = 0; row < o->count; row += o->bonds)
                for (integer i = row + known; i < row + now; i++)
                    o->after[i] = o->before[i], o->rate_after[i] = o->rate_before[i];
        }
    }
    if (steps > 0) o->known = 1 + looking;
    return 0;
}

/* Undo in the output velocities the correction of later kicks for a contact b that has just
   closed, or add the pending one for a contact that opens soon: events are corrected for all
   kicks at once. */
static void postprocess_event(const scene *c, const openings *o, integer b)
{
    const real w0 = o->after[b], w1 = o->before[b], d0 = o->rate_after[b], d1 = o->rate_before[b];
    const real p[4] = {w0, d0, 3 * (w1 - w0) - 2 * d0 - d1, 2 * (w0 - w1) + d0 + d1};
    const int opens = w0 > 0;
    if (opens && !(cubic(p, 2) < 0)) return;
    const real x = opens ? root_between(p, 1, 2) : root_between(p, 0, 1);
    const crossing at = crossing_at(c, o, b, p, x);
    if (!(at.rate > 0)) return;
    real moment;
    const real all = exterior_error(o, b, at, x, opens, &moment);
    const real total = all + between(o, b, at, x, opens, opens, &moment);
    apply_impulse(c, o, b, w1, 1, (opens ? 1 : -1) * o->strength[KINK(b)] * total, 0, 0);
}

/* Whether a contact is closed, and has just closed or opens soon. */
static inline integer needs_postprocessing(real w0, real w1, real d1)
{
    return (w1 > 0) & ((w0 <= 0) | (w1 < -2 * d1));
}

/* Turn copies of u and v after the last step of `advance_openings` into the output state. */
integer postprocess_openings(const scene *given, openings *o, real *u, real *v)
{
    FLUSH
    scene copy = *given;
    const scene *c = &copy;
    copy.u = u, copy.v = v;
    if (!o->known) return 0;
    if (o->known == 1) {
        overlaps(c, o, o->u, o->v, o->after, o->rate_after);
        overlaps(c, o, c->u, c->v, o->before, o->rate_before);
        o->known = 2;
    }
    const real *restrict w0 = o->after, *restrict w1 = o->before, *restrict d1 = o->rate_before;
    int met = 0;
    BLOCKS_OF_CONTACTS(c, o, start, n) {
        integer any = 0;
        EACH(n) any |= needs_postprocessing(w0[start + i], w1[start + i], d1[start + i]);
        if (!any) continue;
        if (!met) keep_end(c, o);
        met = 1;
        for (integer i = start; i < start + n; i++)
            if (needs_postprocessing(w0[i], w1[i], d1[i])) postprocess_event(c, o, i);
    }
    return 0;
}
