/* A run with its rows: whole steps of any compiled loop, and copies of what is looked at.

   Compiled once for all scenes: it calls the loops of others by their addresses, and knows of
   them only the numbers that they advance.  All in double precision. */

#include <math.h>
#include <string.h>

typedef long long integer;

/* Steps of a loop: its function, the one or two structures that it takes, the arrays it advances. */
typedef struct {
    void *function, *first, *second;
    double *u, *v;
} task;

typedef struct {
    task begin, step, close; /* `function` 0 where a method has no such part */
    integer *begins;         /* told where the first step of a run is to come; or 0 */
    integer size;            /* numbers in u */
} walk;

static void bring(double *to, const double *from, integer n)
{
    if (to != from) memcpy(to, from, n * sizeof *to);
}

static void carry_out(const task *t, integer steps)
{
    if (t->second)
        ((void (*)(void *, void *, integer))t->function)(t->first, t->second, steps);
    else
        ((void (*)(void *, integer))t->function)(t->first, steps);
}

/* The same steps on a copy of what `from` advances. */
static const task *copied(const task *t, const task *from, integer size)
{
    if (!t->function) return from;
    bring(t->u, from->u, size);
    bring(t->v, from->v, size);
    carry_out(t, 1);
    return t;
}

/* What is looked at: with closing kicks. */
static const task *shown(const walk *w)
{
    return copied(&w->close, &w->step, w->size);
}

/* Go from step `done` to another, the first step by its own loop; the step that was reached. */
static integer reached(const walk *w, integer done, integer at)
{
    const integer size = w->size;
    if (done == 0 && at > 0 && w->begins) *w->begins = 1;
    if (done == 0 && at > 0 && w->begin.function) {
        bring(w->begin.u, w->step.u, size);
        bring(w->begin.v, w->step.v, size);
        carry_out(&w->begin, 1);
        bring(w->step.u, w->begin.u, size);
        bring(w->step.v, w->begin.v, size);
        done = 1;
    }
    if (at > done) carry_out(&w->step, at - done);
    return at;
}

/* Go from step `done` to each of `count` others, `at`, and keep the first `sites` numbers of u
   and v there, and the `more` of v from `place` on; of the last one only if `last` is kept too. */
void go(const walk *w, integer done, const integer *at, integer count, integer last,
        integer sites, double *rows_u, double *rows_v, integer place, integer more, double *extra)
{
    for (integer k = 0; k < count; k++) {
        done = reached(w, done, at[k]);
        const task *seen = shown(w);
        if (k == count - 1 && !last) return;
        memcpy(rows_u + k * sites, seen->u, sites * sizeof *rows_u);
        memcpy(rows_v + k * sites, seen->v, sites * sizeof *rows_v);
        if (more) memcpy(extra + k * more, seen->v + place, more * sizeof *extra);
    }
}

/* Energies of rows, by a function of `energies.c`. */
typedef struct {
    integer (*function)(const void *, integer, integer, const double *, const double *, integer,
                        integer, const double *, const double *, double *, double *);
    const void *sets;
    integer count, all;
    const double *mass, *loads;
    integer entries;
    double *scratch;
} told;

/* All that a run of a scene takes besides its start, its step and its rows. */
typedef struct {
    walk walk;
    const double *coefficients;    /* of all parts, for a step of 1 */
    double *steps;                 /* where these parts take them from */
    const double *blank;           /* no elongation met */
    double *met;                   /* what the parts met */
    double *travel;
    const integer *spring, *low, *high; /* whose each range in `met` is, and where its ends are */
    double *ranges;                /* of each run (2, springs, 2): of each spring; 0 included */
    double *gaps;                  /* of two runs, in u and in v, as of `compare` */
    integer taken, kept;           /* numbers of coefficients and of elongations */
    integer state, more;           /* numbers in u of a state, and of walls behind it */
    integer places, springs;       /* numbers of ranges in `met`, and of springs */
} plan;

/* One run: its step [s] and steps; after how many of these the state is kept in rows, and the
   energies of these, and after how many in what is compared; 0 for never. */
typedef struct {
    double dt;
    integer steps, every;
    double *rows_u, *rows_v, *extra, *total;
    integer apart;
    double *seen_u, *seen_v, *ways;
} course;

/* What is looked at after so many steps: u, v and impulses to where they are kept. */
static void look(const plan *p, const double *u, const double *v, double *to_u, double *to_v,
                 double *extra)
{
    bring(to_u, u, p->state);
    bring(to_v, v, p->state);
    if (extra) bring(extra, v + p->state, p->more);
}

/* The widest ranges that each spring met. */
static void fold(const plan *p, double *ranges)
{
    double (*met)[2] = (double (*)[2])ranges, (*wide)[2] = met + p->springs;
    for (integer s = 0; s < p->springs; s++) met[s][0] = INFINITY, met[s][1] = -INFINITY;
    for (integer i = 0; i < p->places; i++) {
        double *range = met[p->spring[i]];
        const double low = p->met[p->low[i]], high = p->met[p->high[i]];
        range[0] = low < range[0] ? low : range[0];
        range[1] = high > range[1] ? high : range[1];
    }
    for (integer s = 0; s < p->springs; s++)
        wide[s][0] = met[s][0] < 0 ? met[s][0] : 0, wide[s][1] = met[s][1] > 0 ? met[s][1] : 0;
}

static int is_finite(const double *x, integer n)
{
    double none = 0;
    for (integer i = 0; i < n; i++) none += 0 * x[i];
    return none == 0;
}

/* Largest size of one array, and largest difference of two. */
void compare(const double *restrict one, const double *restrict other, integer n, double *found)
{
    FLUSH
    double size[16] = {0}, gap[16] = {0};
    integer i = 0;
    for (; i < n - n % 16; i += 16)
        for (int k = 0; k < 16; k++) {
            const double a = other[i + k] < 0 ? -other[i + k] : other[i + k];
            const double d = one[i + k] - other[i + k], b = d < 0 ? -d : d;
            size[k] = a > size[k] ? a : size[k];
            gap[k] = b > gap[k] ? b : gap[k];
        }
    for (; i < n; i++) {
        const double a = other[i] < 0 ? -other[i] : other[i];
        const double d = one[i] - other[i], b = d < 0 ? -d : d;
        size[0] = a > size[0] ? a : size[0];
        gap[0] = b > gap[0] ? b : gap[0];
    }
    for (int k = 1; k < 16; k++) {
        size[0] = size[k] > size[0] ? size[k] : size[0];
        gap[0] = gap[k] > gap[0] ? gap[k] : gap[0];
    }
    found[0] = size[0], found[1] = gap[0];
}

/* A whole run from u and v: the state at 0 and after every `every` steps, and at the end, to rows,
   whose energies go to `total` where `t` says how; after every `apart` to what is compared, and how
   far sites went by then.  Returns whether the end is finite, and 2 more where the energies are
   there. */
static integer ran(const plan *p, const double *u, const double *v, course c, double *ranges,
                   const told *t)
{
    const walk *w = &p->walk;
    const integer size = w->size, state = p->state, more = p->more;
    for (integer i = 0; i < p->taken; i++) p->steps[i] = p->coefficients[i] * c.dt;
    memcpy(p->met, p->blank, p->kept * sizeof *p->met);
    *p->travel = 0;
    memset(w->step.u, 0, size * sizeof *u);
    memset(w->step.v, 0, size * sizeof *v);
    memcpy(w->step.u, u, state * sizeof *u);
    memcpy(w->step.v, v, state * sizeof *v);
    if (c.every) look(p, w->step.u, w->step.v, c.rows_u, c.rows_v, more ? c.extra : 0);
    if (c.apart) look(p, w->step.u, w->step.v, c.seen_u, c.seen_v, 0);
    const task *seen = &w->step;
    const double *first_u = c.rows_u, *first_v = c.rows_v;
    const integer every = c.every ? c.every : c.steps, apart = c.apart ? c.apart : c.steps;
    for (integer done = 0, row = every, other = apart; done < c.steps;) {
        if (row > c.steps) row = c.steps;
        const integer at = row < other ? row : other;
        done = reached(w, done, at);
        seen = shown(w);
        if (at == row) {
            row += every;
            if (c.every) {
                c.rows_u += state, c.rows_v += state, c.extra += more;
                look(p, seen->u, seen->v, c.rows_u, c.rows_v, more ? c.extra : 0);
            }
        }
        if (at == other) {
            other += apart;
            if (c.apart) {
                c.seen_u += state, c.seen_v += state;
                look(p, seen->u, seen->v, c.seen_u, c.seen_v, 0);
                *c.ways++ = *p->travel;
            }
        }
    }
    fold(p, ranges);
    if (!is_finite(seen->u, state) || !is_finite(seen->v, state)) return 0;
    const integer rows = (c.rows_u - first_u) / state + 1;
    return 1 + 2 * (t && c.total && t->function(t->sets, t->count, t->all, t->mass, t->loads, t->entries,
                                           rows, first_u, first_v, t->scratch, c.total));
}

/* What makes a course, and it. */
#define COURSE(c) \
    double dt##c, integer steps##c, integer every##c, double *rows_u##c, double *rows_v##c, \
        double *extra##c, double *total##c, integer apart##c, double *seen_u##c, double *seen_v##c, \
        double *ways##c
#define MADE(c) \
    (course){dt##c,    steps##c, every##c,  rows_u##c, rows_v##c, extra##c, \
             total##c, apart##c, seen_u##c, seen_v##c, ways##c}

/* A run from u and v, as `ran`. */
integer run(const plan *p, const double *u, const double *v, const told *t, COURSE(1))
{
    return ran(p, u, v, MADE(1), p->ranges, t);
}

/* Another one behind it, if it ends well, and their gaps at the instants at which both are seen. */
integer twice(const plan *p, const double *u, const double *v, const told *t, COURSE(1), COURSE(2))
{
    if (!ran(p, u, v, MADE(1), p->ranges, t)) return 0;
    const integer done = ran(p, u, v, MADE(2), p->ranges + 4 * p->springs, t);
    const integer n = (steps2 / apart2 + 1) * p->state;
    compare(seen_u1, seen_u2, n, p->gaps);
    compare(seen_v1, seen_v2, n, p->gaps + 2);
    return done;
}
