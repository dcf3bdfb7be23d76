/* The chain of the page: scenes set from outside, steps, energies, and when its leading pulse
   passes each bond.  Behind the text of the loop, whose `scene` it fills.

   Numbers of a prism are worked out in long double, which is quadruple precision here: rounded
   once, they are those that are taken elsewhere from arithmetic of 40 decimals. */

#define SITES 401
#define SEGMENTS 2
#define SAMPLES 64           /* of a curve, where its largest stiffness or load is looked for */
#define SHARE 0.2            /* of the largest elongation: from there a pulse counts */
#define HELD_BACK 0.999      /* of the way to an end of a domain, where values are requested */
#define PART 0.8             /* of the way that all energy would drive one spring: what to expect */
#define ROUGH 0.5            /* of the stability limit: steps longer than that are not taken */

enum { FINE, LOCKED, TOO_LONG };

static real u[SITES], v[SITES], w[SITES], u_before[SITES], v_before[SITES];
static real bond[SITES], passed[SITES], latest[SITES], peak[SITES];
static real shared[SEGMENTS * PARAMETERS], domain[SEGMENTS][2];
static real unloaded[SEGMENTS][PARAMETERS], shift[SEGMENTS]; /* of rigid prisms without preload */
static real lowest[BLOCK * SEGMENTS], highest[BLOCK * SEGMENTS]; /* at each place of a block */
static integer first[SEGMENTS + 1], law[SEGMENTS], own_at[SEGMENTS];
static const integer met_at[SEGMENTS + 1] = {0, BLOCK, 2 * BLOCK};
static real kicks[STAGES + 1], drifts[STAGES], none[1], now;
static scene chain = {u, v, w, shared, none, kicks, drifts, lowest, highest, first, law, own_at,
                      met_at, 0, STAGES, CLOSING};

EXPORT(displacement) real *displacement(void) { return u; }
EXPORT(velocity) real *velocity(void) { return v; }
EXPORT(elongation) real *elongation(void) { return bond; }
EXPORT(parameters) real *parameters(int segment) { return shared + segment * PARAMETERS; }
EXPORT(passage) real *passage(void) { return passed; }
EXPORT(passing) real *passing(void) { return peak; }
EXPORT(last_passage) real *last_passage(void) { return latest; }
EXPORT(instant) real instant(void) { return now; }
EXPORT(end) real end(int segment, int high) { return domain[segment][high]; }

static integer bonds(void) { return first[chain.runs]; }

/* The order-th derivative of the energy of a segment's springs. */
EXPORT(value) real value(int segment, int order, real r)
{
    const real *p = parameters(segment);
    if (law[segment] == 0)
        switch (order) {
        case 0: return energy_0(r, p);
        case 1: return tension_0(r, p);
        case 2: return stiffness_0(r, p);
        default: return slope_0(r, p);
        }
    switch (order) {
    case 0: return energy_1(r, p);
    case 1: return tension_1(r, p);
    default: return stiffness_1(r, p);
    }
}

static void set_domain(int segment, int which)
{
    const real *p = parameters(segment);
    law[segment] = 2 * which;
    domain[segment][0] = which ? ELASTIC_LOWEST : -p[LOCK];
    domain[segment][1] = which ? ELASTIC_HIGHEST : p[STROKE];
}

/* Elongation at which the first branch carries a preload; 0 where no state does. */
static real loaded(int segment, real preload)
{
    const real lowest = domain[segment][0];
    real high = 0, low = 0;
    for (int k = 1; k <= SAMPLES * SAMPLES; k++) {
        low = lowest * (1 - 1e-12) * sin(1.5707963267948966 * k / (SAMPLES * SAMPLES));
        if (value(segment, 1, low) + preload <= 0) break;
        if (value(segment, 2, low) < 0) return 0;
        high = low;
    }
    for (int k = 0; k < 200; k++) {
        const real middle = (low + high) / 2;
        if (middle == low || middle == high) break;
        if (value(segment, 1, middle) + preload > 0) high = middle;
        else low = middle;
    }
    return value(segment, 1, low) + preload > 0 ? 0 : (low + high) / 2;
}

/* Springs of a segment: rigid prisms of base 1 m. Returns their loaded height [m], 0 where none
   carries the preload. */
EXPORT(rigid) real rigid(int segment, real height, real prestrain, real k_cross, real preload)
{
    real length = height;
    for (int twice = 0; twice < 2; twice++) {
        const real load = twice ? preload : 0;
        const long double given[] = {1, height, prestrain, k_cross, HUGE_VAL, HUGE_VAL, length, load};
        long double found[RIGID_PARAMETERS], locking;
        locking_height_squared(given, &locking);
        rigid_parameters(given, found);
        if (locking <= 0) { /* thick: it collapses flat before the bars meet */
            found[LOCK] = found[FAR_LOCK] = length;
            found[NO_LOCK] = -locking;
        }
        for (int k = 0; k < RIGID_PARAMETERS; k++) parameters(segment)[k] = found[k];
        set_domain(segment, 0);
        if (twice == 0) {
            for (int k = 0; k < RIGID_PARAMETERS; k++) unloaded[segment][k] = found[k];
            shift[segment] = preload == 0 ? 0 : loaded(segment, preload);
            if (preload == 0) break;
            if (shift[segment] == 0) return 0;
            length += shift[segment];
        }
    }
    return length;
}

/* Springs of a segment: the prism with elastic members, whose numbers came with the page. */
EXPORT(elastic) real elastic(int segment)
{
    for (int k = 0; k < ELASTIC_PARAMETERS; k++) parameters(segment)[k] = elastic_numbers[k];
    set_domain(segment, 1);
    return ELASTIC_LENGTH;
}

/* No elongation was met. */
static void forget(void)
{
    EACH(BLOCK * SEGMENTS) lowest[i] = highest[i] = 0;
}

/* So many springs in each segment, the first mass held or not; all at rest. */
EXPORT(lay) void lay(int near, int far, int held)
{
    first[0] = 0, first[1] = near, first[2] = near + far;
    chain.runs = far > 0 ? 2 : 1;
    for (int i = 0; i < SITES; i++) u[i] = v[i] = passed[i] = latest[i] = peak[i] = bond[i] = 0, w[i] = 1;
    if (held) w[0] = 0;
    now = 0;
    forget();
}

static int segment_of(integer b) { return chain.runs > 1 && b >= first[1]; }

/* Energy of the sites from one on, and of the springs behind them. */
EXPORT(energy) real energy(int from)
{
    real total = 0;
    for (integer i = from; i <= bonds(); i++)
        if (w[i] != 0) total += v[i] * v[i] / (2 * w[i]);
    for (integer b = from; b < bonds(); b++) total += value(segment_of(b), 0, u[b + 1] - u[b]);
    return total;
}

EXPORT(show) void show(real time) { now = time; }

/* Continue from u and v that were set, at a time: what passed later did not. */
EXPORT(resume) void resume(real time)
{
    now = time;
    for (integer b = 0; b < bonds(); b++) {
        bond[b] = u[b + 1] - u[b];
        if (passed[b] > time) passed[b] = peak[b] = 0;
        if (latest[b] > time) latest[b] = 0;
    }
}

/* Twist of a rigid prism [rad], from the parameters without preload: where the bars stand upright
   it is 0. */
EXPORT(twist) real twist(int segment, real r)
{
    const real *p = unloaded[segment];
    return 2 * (atan(half_turn_0(shift[segment] + r, p)) - atan(half_turn_0(p[STROKE], p)));
}

/* Largest stiffness of a segment between two elongations. */
static real stiffest(int segment, real low, real high)
{
    real most = 0;
    for (int k = 0; k <= SAMPLES; k++)
        most = larger(most, value(segment, 2, low + (high - low) * k / SAMPLES));
    return most;
}

/* How far one spring is driven by an energy, one way; at most `HELD_BACK` of the domain. */
EXPORT(reached) real reached(int segment, real joules, int high)
{
    real in = 0, out = HELD_BACK * domain[segment][high];
    if (value(segment, 0, out) <= joules) return out;
    for (int k = 0; k < 60; k++) {
        const real middle = (in + out) / 2;
        if (value(segment, 0, middle) < joules) in = middle;
        else out = middle;
    }
    return out;
}

/* Stability limit [s] of a chain of unit masses: its fastest mode is 2 sqrt(stiffness). */
static real largest_step(real stiffness)
{
    return stiffness > 0 ? LIMIT / (2 * sqrt(stiffness)) : 1e300;
}

/* Step [s] for what a spring is expected to meet. */
EXPORT(expected_step) real expected_step(void)
{
    real most = 0;
    const real joules = energy(0);
    for (int s = 0; s < chain.runs; s++)
        most = larger(most, stiffest(s, PART * reached(s, joules, 0), PART * reached(s, joules, 1)));
    return STEP * largest_step(most);
}

/* Instants and peaks of the pulse that leads, bond by bond, and the last instant at which one
   passed: where |r| turns, by a cubic. */
static void watch(real dt)
{
    real largest = 0;
    for (integer b = 0; b < bonds(); b++) largest = larger(largest, fabs(u[b + 1] - u[b]));
    for (integer b = 0; b < bonds(); b++) {
        const real r = u[b + 1] - u[b], before = bond[b];
        bond[b] = r;
        if (fabs(r) < SHARE * largest) continue;
        const real rate = v[b + 1] - v[b], rate_before = v_before[b + 1] - v_before[b];
        const real sign = r > 0 ? 1 : -1;
        if (!(sign * rate_before > 0 && sign * rate <= 0)) continue;
        const real p[4] = {before, dt * rate_before,
                           3 * (r - before) - dt * (2 * rate_before + rate),
                           2 * (before - r) + dt * (rate_before + rate)};
        real low = 0, high = 1;
        for (int k = 0; k < 40; k++) {
            const real x = (low + high) / 2;
            if (sign * (p[1] + x * (2 * p[2] + 3 * x * p[3])) > 0) low = x;
            else high = x;
        }
        latest[b] = now - dt * (1 - low);
        if (passed[b] != 0) continue;
        passed[b] = latest[b];
        peak[b] = p[0] + low * (p[1] + low * (p[2] + low * p[3]));
    }
}

/* Whether a step is valid: no spring beyond its domain, none too stiff for the step. */
static int checked(real dt)
{
    for (int s = 0; s < chain.runs; s++) {
        const integer springs = first[s + 1] - first[s], places = springs < BLOCK ? springs : BLOCK;
        const integer at = met_at[s];
        real low = 0, high = 0;
        EACH(places) low = smaller(lowest[at + i], low), high = larger(highest[at + i], high);
        if (!(low > domain[s][0] && high < domain[s][1])) return LOCKED;
        const real k = larger(value(s, 2, low), value(s, 2, high));
        if (!(dt <= ROUGH * largest_step(k))) return TOO_LONG;
    }
    for (integer i = 0; i <= bonds(); i++)
        if (!(fabs(u[i]) < 1e300 && fabs(v[i]) < 1e300)) return LOCKED;
    return FINE;
}

/* At most so many steps; stops before one that is not valid, and says why. */
EXPORT(run) int run(int steps, real dt)
{
    const real row[] = {KICKS}, column[] = {DRIFTS};
    for (int k = 0; k <= STAGES; k++) kicks[k] = dt * row[k];
    for (int k = 0; k < STAGES; k++) drifts[k] = dt * column[k];
    for (int k = 0; k < steps; k++) {
        for (integer i = 0; i <= bonds(); i++) u_before[i] = u[i], v_before[i] = v[i];
        forget();
        advance(&chain, 0, 1, 0);
        postprocess(&chain, 0, u, v);
        const int found = checked(dt);
        if (found != FINE) {
            for (integer i = 0; i <= bonds(); i++) u[i] = u_before[i], v[i] = v_before[i];
            return found;
        }
        now += dt;
        watch(dt);
    }
    return FINE;
}
