/* Steps of any compiled loop, with the states that somebody wants on the way.

   Compiled once for all scenes: it calls the loops of others by their addresses, and knows of
   them only the numbers that they advance.  All in double precision. */

#include <string.h>

/* A bound loop: `advance` goes on without the closing kick of its last step, `opened` by that of the
   step before; `postprocess` makes copies of u and v the state there, 0 where they are it already.  Both
   return whether they had to stop. */
typedef struct {
    integer (*advance)(void *scene, void *method, integer steps, integer opened);
    integer (*postprocess)(void *scene, void *method, double *u, double *v);
    void *scene, *method;
    const double *u, *v;
    double *output_u, *output_v;
    const double *sums;   /* (sum_count) of what is write_output: work, loss */
    const double *travel; /* bound on how far any coordinate of a site moved */
    integer size;         /* numbers in u */
    integer sum_count;
} loop;

/* States after the steps `at`, increasing: the first `size` numbers of u and v, `walls` of v from
   `behind` on, sums, and the way travelled by then; as the loop has them if `raw`.  Or, where there
   are `places`, these entries of u, `u_count` of them, and then of v, as the loop has them. */
typedef struct {
    const integer *at, *places;
    double *u, *v, *impulse, *sums, *travel;
    integer count, raw, size, behind, walls, entries, u_count;
} wanted;

enum { DONE, STOPPED, NOT_FINITE };

static void copy(double *to, const double *from, integer n) { memcpy(to, from, n * sizeof *to); }

/* Copies of u and v, as the state. */
static integer write_output(const loop *l, double *u, double *v)
{
    copy(u, l->u, l->size);
    copy(v, l->v, l->size);
    return l->postprocess && l->postprocess(l->scene, l->method, u, v);
}

static void take(const loop *l, wanted *w, integer raw)
{
    if (w->places)
        for (integer j = 0; j < w->entries; j++)
            *w->u++ = j < w->u_count ? l->u[w->places[j]] : l->v[w->places[j]];
    else {
        const double *u = raw ? l->u : l->output_u, *v = raw ? l->v : l->output_v;
        copy(w->u, u, w->size);
        copy(w->v, v, w->size);
        w->u += w->size, w->v += w->size;
        if (w->walls) copy(w->impulse, v + w->behind, w->walls), w->impulse += w->walls;
        if (w->sums) copy(w->sums, l->sums, l->sum_count), w->sums += l->sum_count;
        if (w->travel) *w->travel++ = *l->travel;
    }
    w->at++, w->count--;
}

static int is_finite(const double *x, integer n)
{
    double none[8] = {0}, all = 0; /* apart, so that additions do not wait for each other */
    for (integer i = 0; i < n; i++) none[i % 8] += 0 * x[i];
    for (int k = 0; k < 8; k++) all += none[k];
    return all == 0;
}

/* Go from step `done` to `end`, which is write_output; a run begins with step 0, as it is.  Whether all is
   well, the loop had to stop, or the first `sites` numbers are not finite. */
integer go(const loop *l, integer done, integer end, wanted *each, integer count, integer sites)
{
    FLUSH
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
        const int alone = seen == 1 && done < end && only->size == l->size && !only->sums
            && (only->count == 1 || only->at[1] > done);
        if (alone) { /* straight to its place */
            if (write_output(l, only->u, only->v)) return STOPPED;
            only->u += l->size, only->v += l->size, only->at++, only->count--;
        } else if (seen || done == end)
            if (write_output(l, l->output_u, l->output_v)) return STOPPED;
        for (integer k = 0; k < count; k++)
            while (each[k].count && *each[k].at == done) take(l, each + k, each[k].raw);
    }
    return is_finite(l->output_u, sites) && is_finite(l->output_v, sites) ? DONE : NOT_FINITE;
}
