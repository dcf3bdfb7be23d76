/* Overlaps of contacts, and the impulses applied where one opens or closes.

   A contact is closed where w = side (elongation - place) > 0; it adds side strength w^exponent
   to the tension.  A bond whose force has several kinks counts as several contacts, contact k
   bonds + b for kink k of bond b; NaN where a bond has fewer.  KINK(b) is the entry of contact b
   among the kinks: of a chain one for each contact, of a network one for each spring. */
typedef struct {
    const real *place, *side, *strength; /* (kinks) */
    const real *exponents, *betas;       /* (rows), integral of (y (1 - y))^exponent */
    const real *tables;                  /* (rows, 3, degree + 1), `openings.zetas` */
    const real *nodes, *weights, *offsets; /* (kicks) of a step, over dt, dt and dt^2 */
    const real *dt;
    real *before, *rate_before, *after, *rate_after; /* (contacts) overlap, and rate times dt */
    real *u, *v;                         /* (entries) at the beginning of a step */
    real *end_u, *end_v, *end_a;         /* (entries) at its end, before it is corrected */
    const integer *row;                  /* (kinks) of its exponent */
    const int *spring;                   /* (bonds) of a network */
    integer count, bonds, entries, kicks, degree; /* contacts, and those of one kink per bond */
    integer springs;
    integer known; /* of the last step: 0 nothing, 1 its beginning in u and v, 2 its overlaps */
    integer begins; /* whether the next step is the first of a run */
    integer alone; /* whether steps are single ones, which end in their output state */
} openings;

/* The cable over sites of which a contact is a segment, or -1. */
static integer cable_of(const scene *c, const openings *o, integer b)
{
    for (integer q = 0; q < c->cables; q++)
        for (integer s = c->strand_at[q]; s < c->strand_at[q + 1]; s++)
            if (c->strand_place[s] == b % o->bonds) return q;
    return -1;
}

#ifndef DIM /* a chain, whose bonds do not rotate */
#define DIM 1
#define AXES(k) for (int k = 0; k < DIM; k++)
#define FROM(b) ((b) % o->bonds)
#define KINK(b) (b)

/* Entry of the second end of a contact: of the last one of a ring, the first site. */
static integer second(const scene *c, const openings *o, integer b)
{
    const integer to = FROM(b) + BATCH;
    return c->stretch && to >= o->bonds ? to - o->bonds : to;
}
#define TO(b) second(c, o, b)

/* Of n entries of a chain, those that may move. */
static integer moving(const scene *c, integer n)
{
    return c->active && *c->active < n ? *c->active : n;
}

static integer next_stage(const scene *c) { return 0; }

static void overlaps(const scene *c, const openings *o, const real *restrict u,
                     const real *restrict v, real *restrict w, real *restrict d)
{
    const real dt = *o->dt;
    for (integer start = 0; start < o->count; start += o->bonds) {
        const real *restrict place = o->place + start, *restrict side = o->side + start;
        EACH(moving(c, o->bonds)) {
            w[start + i] = side[i] * ((u[i + BATCH] - u[i]) - place[i]);
            d[start + i] = side[i] * dt * (v[i + BATCH] - v[i]);
        }
    }
}

static void renew_overlaps(const scene *c, openings *o, integer since, const real *w, const real *d)
{
    overlaps(c, o, c->u, c->v, o->after, o->rate_after);
}

static int may_pass(const scene *c, const openings *o)
{
    for (integer s = 0; s < c->runs; s++) {
        const integer start = BATCH * c->first[s];
        const integer ranges = c->range_at[s + 1] - c->range_at[s];
        const real *low = c->low + c->range_at[s], *high = c->high + c->range_at[s];
        integer any = 0;
        for (integer k = 0; k < o->count; k += o->bonds) {
            const real *place = o->place + k + start; /* equal for all bonds of one spring */
            if (c->law[s] & 1) EACH(ranges) any |= (low[i] <= place[i]) & (high[i] >= place[i]);
            else EACH(ranges) any |= (low[i] <= *place) & (high[i] >= *place);
        }
        if (any) return 1;
    }
    return 0;
}

static void keep_end(const scene *c, const openings *o) {}

static real line_at(const scene *c, const openings *o, integer contact, real x, real *line,
                    real *turn)
{
    return *line = 1, *turn = 0;
}

static real mobility_along(const scene *c, integer from, integer to, const real *line)
{
    return *line * *line * (c->w[from] + c->w[to]);
}

static real mobility_of_cable(const scene *c, const openings *o, integer q, real part) { return 0; }

static void apply_impulse(const scene *c, const openings *o, integer b, real w, real x, real total,
                 real moment, real turning)
{
    const integer from = FROM(b), to = TO(b);
    const real dt = *o->dt, side = o->side[KINK(b)], left = c->w[from], right = c->w[to];
    const real impulse = dt * side * total;
    real shift = dt * (dt * side * moment + (1 - x) * impulse);
    if (fabs(shift) * (left + right) >= fabs(w)) shift = 0; /* w would change sign */
    c->v[from] += left * impulse;
    c->v[to] -= right * impulse;
    c->u[from] += left * shift;
    c->u[to] -= right * shift;
    close_ring(c, c->u, c->v);
}
#else
#define FROM(b) c->from[(b) % o->bonds]
#define TO(b) c->to[(b) % o->bonds]
#define KINK(b) (o->spring[(b) % o->bonds] + (b) / o->bonds * o->springs)

#define AT_ONCE (ROOM * WIDE) /* contacts */

static integer moving(const scene *c, integer n) { return n; }

static integer next_stage(const scene *c) { return c->active ? *c->active : 0; }

/* Whether the tiles of n sites, and so the other ends of their contacts, have not moved from a
   stage on. */
static int at_rest(const scene *c, const int *sites, integer n, integer since)
{
    if (!c->active) return 0;
    for (integer i = 0; i < n; i++)
        if (c->active[1 + sites[i] / (TILE * DIM)] >= since) return 0;
    return 1;
}

static void run_of(const scene *c, const openings *o, integer s, const real *restrict u,
                   const real *restrict v, const real *same_w, const real *same_rate, integer since,
                   real *w, real *rate, const int wall)
{
    const integer n = c->contacts, last = c->first[s + 1];
    const real *restrict geometry = c->geometry, dt = *o->dt;
    for (integer b = c->first[s], some; b < last; b += some) {
        some = last - b < AT_ONCE ? last - b : AT_ONCE;
        const int *from = c->from + b, *to = c->to + b, *spring = o->spring + b;
        if (same_w && at_rest(c, wall ? to : from, some, since)) {
            for (integer j = b; j < o->count; j += o->bonds)
                EACH(some) w[j + i] = same_w[j + i], rate[j + i] = same_rate[j + i];
            continue;
        }
        pack stored[STORED][ROOM], along[DIM][ROOM], speed[DIM][ROOM], r[ROOM];
        const real *gaps = geometry + DIM * n + b, *lengths = gaps + n;
        const integer packs = (some + WIDE - 1) / WIDE;
        for (integer g = 0; g < packs; g++) { /* the arrays end with zeros, which fill a pack */
            int rows[2][WIDE];
            pack at[DIM], separation[DIM], other[DIM];
            LANES_OF(l) rows[0][l] = to[g * WIDE + l] / DIM, rows[1][l] = from[g * WIDE + l] / DIM;
            AXES(k) at[k] = load(geometry + k * n + b + g * WIDE), other[k] = wide(0);
            columns(u, rows[0], separation);
            if (!wall) columns(u, rows[1], other);
            AXES(k) separation[k] -= other[k];
            (wall ? first_wall : first_pair)(
                g, at, separation, gaps, WIDE, lengths, WIDE, r, along, stored);
            columns(v, rows[0], separation);
            if (!wall) columns(v, rows[1], other);
            AXES(k) speed[k][g] = separation[k] - other[k];
        }
        (wall ? rest_wall : rest_pair)(packs, gaps, WIDE, lengths, WIDE, r, along, stored);
        real elongation[AT_ONCE + WIDE], change[AT_ONCE + WIDE];
        for (integer g = 0; g < packs; g++) {
            pack sum = along[0][g] * speed[0][g];
            for (int k = 1; k < DIM; k++) sum += along[k][g] * speed[k][g];
            store(elongation + g * WIDE, r[g]), store(change + g * WIDE, sum);
        }
        const real *restrict side = o->side, *restrict place = o->place;
        for (integer j = b; j < o->count; j += o->bonds, side += o->springs, place += o->springs)
            EACH(some) {
                w[j + i] = side[spring[i]] * (elongation[i] - place[spring[i]]);
                rate[j + i] = side[spring[i]] * dt * change[i];
            }
    }
}

__attribute__((flatten)) static void overlaps_since(
    const scene *c, const openings *o, const real *u, const real *v, const real *same_w,
    const real *same_rate, integer since, real *w, real *rate)
{
    for (integer s = 0; s < c->runs; s++)
        if (c->law[s] & 2) run_of(c, o, s, u, v, same_w, same_rate, since, w, rate, 1);
        else run_of(c, o, s, u, v, same_w, same_rate, since, w, rate, 0);
}

/* Give the segments of each cable over sites the mean of theirs. */
static void share(const scene *c, const openings *o, real *w, real *rate)
{
    for (integer q = 0; q < c->cables; q++)
        for (integer j = 0; j < o->count; j += o->bonds) {
            const integer *first = c->strand_place + c->strand_at[q];
            const integer n = c->strand_at[q + 1] - c->strand_at[q];
            real sum = 0, sum_rate = 0;
            EACH(n) sum += w[j + first[i]], sum_rate += rate[j + first[i]];
            EACH(n) w[j + first[i]] = sum / n, rate[j + first[i]] = sum_rate / n;
        }
}

static void overlaps(const scene *c, const openings *o, const real *u, const real *v, real *w,
                     real *d)
{
    overlaps_since(c, o, u, v, 0, 0, 0, w, d);
    share(c, o, w, d);
}

static void renew_overlaps(const scene *c, openings *o, integer since, const real *w, const real *d)
{
    overlaps_since(c, o, c->u, c->v, w, d, since, o->after, o->rate_after);
    share(c, o, o->after, o->rate_after);
}

/* By the common elongation range of all contacts of a run. */
static int may_pass(const scene *c, const openings *o)
{
    integer any = 0;
    for (integer s = 0; s < c->runs; s++) {
        const real *low = c->low + c->range_at[s], *high = c->high + c->range_at[s];
        const integer start = c->first[s], count = c->first[s + 1] - start;
        const integer met = c->range_at[s + 1] - c->range_at[s];
        real least = low[0], most = high[0];
        EACH(met) least = smaller(low[i], least), most = larger(high[i], most);
        const int *spring = o->spring + start;
        const real *place = o->place;
        for (integer k = start; k < o->count; k += o->bonds, place += o->springs)
            EACH(count) any |= (least <= place[spring[i]]) & (most >= place[spring[i]]);
    }
    return any != 0;
}

static void keep_end(const scene *c, const openings *o)
{
    acceleration(c, c->u, o->end_a, o->entries);
    EACH(o->entries) o->end_u[i] = c->u[i], o->end_v[i] = c->v[i];
}

static int is_wall(const scene *c, integer b)
{
    integer s = 0;
    while (c->first[s + 1] <= b) s++;
    return (c->law[s] & 2) != 0;
}

/* Unit vector of a contact at the event, a part 1 - x of the step ago, its rate of rotation, and
   the length of the line; the last two are 0 where it does not rotate. */
static real line_at(const scene *c, const openings *o, integer contact, real x, real *line,
                    real *turn)
{
    const integer b = contact % o->bonds;
    const real back = (1 - x) * *o->dt;
    AXES(k) line[k] = c->geometry[k * c->contacts + b], turn[k] = 0;
    if (DIM == 1 || is_wall(c, b)) return 0;
    const integer from = FROM(b), to = TO(b);
    real square = 0, along = 0;
    AXES(k) {
        const real pull = o->end_a[to + k] - o->end_a[from + k];
        const real speed = o->end_v[to + k] - o->end_v[from + k];
        line[k] += o->end_u[to + k] - o->end_u[from + k] - back * (speed - back / 2 * pull);
        turn[k] = speed - back * pull;
        square += line[k] * line[k];
    }
    const real length = sqrt(square);
    AXES(k) line[k] /= length, along += line[k] * turn[k];
    AXES(k) turn[k] = (turn[k] - along * line[k]) / length;
    return length;
}

/* With bonds with mass: what a force on the first end of a contact, and its opposite on the second,
   adds to the velocities of all rows. */
static const real *spread(const scene *c, integer from, integer to, const real *pull)
{
    const integer n = c->rows * DIM;
    real *x = c->spread;
    EACH(n) x[i] = 0;
    AXES(k) x[from + k] += pull[k], x[to + k] -= pull[k];
    COUPLE(c, x, DIM)
    EACH(n) x[i] *= c->w[i];
    return x;
}

static real mobility_along(const scene *c, integer from, integer to, const real *line)
{
    real sum = 0;
    if (c->couplings) {
        const real *x = spread(c, from, to, line);
        const int wall = from >= c->sites * DIM;
        AXES(k) sum += line[k] * ((wall ? 0 : x[from + k]) - x[to + k]);
    } else
        AXES(k) sum += line[k] * line[k] * (c->w[from + k] + c->w[to + k]);
    return sum;
}

/* The same of a cable, the contacts of whose segments all have it: of its mean elongation. */
static real mobility_of_cable(const scene *c, const openings *o, integer q, real part)
{
    const integer *place = c->strand_place + c->strand_at[q], n = c->rows * DIM;
    const integer segments = c->strand_at[q + 1] - c->strand_at[q];
    real line[DIM], turn[DIM], sum = 0, *x = c->spread;
    EACH(n) x[i] = 0;
    for (integer s = 0; s < segments; s++) {
        line_at(c, o, place[s], part, line, turn);
        AXES(k) x[FROM(place[s]) + k] += line[k], x[TO(place[s]) + k] -= line[k];
    }
    COUPLE(c, x, DIM)
    EACH(n) x[i] *= c->w[i];
    for (integer s = 0; s < segments; s++) {
        line_at(c, o, place[s], part, line, turn);
        AXES(k) sum += line[k] * (x[FROM(place[s]) + k] - x[TO(place[s]) + k]);
    }
    return sum / segments;
}

/* Add a rounded number, so that equal and opposite ones cancel to the last bit. */
static void add(real *to, real part)
{
    __asm__("" : "+m"(part));
    *to += part;
}

static void apply_impulse(const scene *c, const openings *o, integer b, real w, real x, real total,
                 real moment, real turning)
{
    const integer from = FROM(b), to = TO(b);
    const real dt = *o->dt, side = o->side[KINK(b)], back = (1 - x) * dt;
    real line[DIM], turn[DIM], impulse[DIM], shift[DIM], size = 0, mobility = 0;
    line_at(c, o, b, x, line, turn);
    AXES(k) {
        impulse[k] = dt * side * (total * line[k] + dt * turning * turn[k]);
        shift[k] = dt * dt * side * moment * line[k] + back * impulse[k];
        size += fabs(shift[k]);
        mobility = larger(mobility, c->w[from + k] + c->w[to + k]);
    }
    if (c->couplings) mobility = mobility_along(c, from, to, line);
    const integer cable = cable_of(c, o, b);
    if (cable >= 0) mobility = mobility_of_cable(c, o, cable, x);
    const real kept = size * mobility >= fabs(w) ? 0 : 1; /* w would change sign */
    if (c->couplings) {
        const integer n = c->rows * DIM;
        const real *x = spread(c, from, to, impulse);
        EACH(n) c->v[i] += x[i];
        x = spread(c, from, to, shift);
        EACH(n) c->u[i] += kept * x[i];
        return;
    }
    AXES(k) {
        add(c->v + from + k, c->w[from + k] * impulse[k]);
        add(c->v + to + k, -c->w[to + k] * impulse[k]);
        add(c->u + from + k, c->w[from + k] * kept * shift[k]);
        add(c->u + to + k, -c->w[to + k] * kept * shift[k]);
    }
    if (c->active) {
        rouse(c, to / (TILE * DIM));
        if (!is_wall(c, b)) rouse(c, from / (TILE * DIM));
    }
}
#endif

static real mobility(const scene *c, const openings *o, integer b, real x)
{
    const integer from = FROM(b), to = TO(b), cable = cable_of(c, o, b);
    real line[DIM], turn[DIM];
    if (cable >= 0) return mobility_of_cable(c, o, cable, x);
    line_at(c, o, b, x, line, turn);
    return mobility_along(c, from, to, line);
}

static real swing_alone(const scene *c, const openings *o, integer b, real x)
{
    real line[DIM], turn[DIM], square = 0;
    const real length = line_at(c, o, b, x, line, turn), dt = *o->dt;
    AXES(k) square += turn[k] * turn[k];
    return o->side[KINK(b)] * dt * dt * length * square;
}

static real swing(const scene *c, const openings *o, integer b, real x)
{
    const integer cable = cable_of(c, o, b);
    if (cable < 0) return swing_alone(c, o, b, x);
    const integer first = c->strand_at[cable], last = c->strand_at[cable + 1];
    real sum = 0;
    for (integer s = first; s < last; s++)
        sum += swing_alone(c, o, c->strand_place[s] + b - b % o->bonds, x);
    return sum / (last - first);
}
