/* Steps of any compiled loop, with output of requested states on the way.

   Compiled once for all scenes: it calls the loop of a scene by its address, and knows only the
   numbers that it advances.  All in double precision. */

#include <string.h>

/* A prepared loop: `advance` does steps without the closing kick of the last one, and begins with
   that of the step before if `opened`; `postprocess` turns copies of u and v into the output state,
   0 where they are it already.  Both return whether they had to stop. */
typedef struct {
    integer (*advance)(void *scene, void *method, integer steps, integer opened);
    integer (*postprocess)(void *scene, void *method, double *u, double *v);
    void *scene, *method;
    const double *u, *v;
    double *output_u, *output_v;
    const double *sums;   /* (sum_count) of the output state: work, loss */
    double *travel; /* bound on how far any coordinate of a site moved */
    double *low, *high;    /* (places) smallest and largest elongation, as the loop notes them */
    const integer *spring; /* (places) the spring, below 0 where the elongation does not count */
    integer *active;       /* (actives) as of the scene, 0 for none; of a scene that may move all
                              over the first number is `all_active`, the others are 0 */
    integer size;          /* numbers in u */
    integer sum_count, places, actives, all_active;
} loop;

/* Requested states after the steps `at`, increasing: the first `size` numbers of u and v,
   `walls` numbers of v from `behind` on, sums, and the distance travelled; before the closing
   kick if `raw`.  Of a loop over `width` scenes, the values of the first `used` ones are written,
   `stride` numbers from one site to the next; all numbers together where `width` is 0.  Or, with
   `places`, these entries of u, `u_count` of them, and then of v, before the closing kick. */
typedef struct {
    const integer *at, *places;
    double *u, *v, *impulse, *sums, *travel;
    integer count, raw, size, behind, walls, entries, u_count, width, used, stride;
} wanted;

enum { DONE, STOPPED, NOT_FINITE };

static void copy(double *to, const double *from, integer n) { memcpy(to, from, n * sizeof *to); }

/* Forget the elongations and the distance travelled; let the next step include all sites, after
   which those that rest are found. */
void begin(loop *l)
{
    for (integer k = 0; k < l->places; k++) l->low[k] = INFINITY, l->high[k] = -INFINITY;
    *l->travel = 0;
    for (integer k = 0; k < l->actives; k++) l->active[k] = k ? 0 : l->all_active;
}

/* Widen the smallest and largest elongation of each spring (springs, 2) by those since `begin`. */
void widen(const loop *l, double *ranges)
{
    for (integer k = 0; k < l->places; k++) {
        if (l->spring[k] < 0) continue;
        double *of = ranges + 2 * l->spring[k];
        if (l->low[k] < of[0]) of[0] = l->low[k];
        if (l->high[k] > of[1]) of[1] = l->high[k];
    }
}

/* Copy u and v, and turn the copies into the output state. */
static integer write_output(const loop *l, double *u, double *v)
{
    copy(u, l->u, l->size);
    copy(v, l->v, l->size);
    return l->postprocess && l->postprocess(l->scene, l->method, u, v);
}

/* Write n numbers of a loop where a request wants them, and what follows behind them. */
static void hand_over(const wanted *w, double **to, const double *from, integer n)
{
    if (w->width)
        for (integer i = 0; i < n; i += w->width, *to += w->stride) copy(*to, from + i, w->used);
    else
        copy(*to, from, n), *to += n;
}

static void take(const loop *l, wanted *w, integer raw)
{
    if (w->places)
        for (integer j = 0; j < w->entries; j++)
            *w->u++ = j < w->u_count ? l->u[w->places[j]] : l->v[w->places[j]];
    else {
        const double *u = raw ? l->u : l->output_u, *v = raw ? l->v : l->output_v;
        hand_over(w, &w->u, u, w->size);
        hand_over(w, &w->v, v, w->size);
        if (w->walls) hand_over(w, &w->impulse, v + w->behind, w->walls);
        if (w->sums) hand_over(w, &w->sums, l->sums, l->sum_count);
        if (w->travel) *w->travel++ = *l->travel;
    }
    w->at++, w->count--;
}

static int is_finite(const double *x, integer n)
{
    double none[8] = {0}, all = 0; /* independent sums, which a processor adds at the same time */
    for (integer i = 0; i < n; i++) none[i % 8] += 0 * x[i];
    for (int k = 0; k < 8; k++) all += none[k];
    return all == 0;
}

/* Advance from step `done` to `end`, and write the output state there; step 0 is the initial state.
   Returns DONE, STOPPED, or NOT_FINITE where one of the first `sites` numbers is not finite. */
integer go(loop *l, integer done, integer end, wanted *each, integer count, integer sites)
{
    FLUSH
    begin(l);
    for (integer k = 0; k < count; k++)
        while (done == 0 && each[k].count && *each[k].at == 0) take(l, each + k, 1);
    while (done < end) {
        integer next = end, seen = 0, last = 0;
        for (integer k = 0; k < count; k++)
            if (each[k].count && *each[k].at < next) next = *each[k].at;
        if (l->advance(l->scene, l->method, next - done, done > 0)) return STOPPED;
        done = next;
        for (integer k = 0; k < count; k++)
            if (each[k].count && *each[k].at == done && !each[k].raw) seen++, last = k;
        wanted *only = each + last;
        const int alone = seen == 1 && done < end && only->size == l->size && !only->width
            && !only->sums && (only->count == 1 || only->at[1] > done);
        if (alone) { /* written in place, without a copy */
            if (write_output(l, only->u, only->v)) return STOPPED;
            only->u += l->size, only->v += l->size, only->at++, only->count--;
        } else if (seen || done == end)
            if (write_output(l, l->output_u, l->output_v)) return STOPPED;
        for (integer k = 0; k < count; k++)
            while (each[k].count && *each[k].at == done) take(l, each + k, each[k].raw);
    }
    return is_finite(l->output_u, sites) && is_finite(l->output_v, sites) ? DONE : NOT_FINITE;
}
