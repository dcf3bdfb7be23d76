/* Steps of any compiled loop, with the states that somebody wants on the way.

   Compiled once for all scenes: it calls the loops of others by their addresses, and knows of
   them only the numbers that they advance.  All in double precision. */

#include <string.h>

typedef long long integer;

/* A bound loop: `advance` goes on without the closing kick of its last step, `opened` by that of the
   step before; `show` makes copies of u and v the state there, 0 where they are it already.  Both
   return whether they had to stop. */
typedef struct {
    integer (*advance)(void *scene, void *method, integer steps, integer opened);
    integer (*show)(void *scene, void *method, double *u, double *v);
    void *scene, *method;
    const double *u, *v;
    double *shown_u, *shown_v;
    const double *sums; /* (sum_count) of what is shown: work, loss */
    integer size;       /* numbers in u */
    integer sum_count;
} loop;

/* States after the steps `at`, increasing: the first `size` numbers of u and v, `walls` of v from
   `behind` on, and sums; as the loop has them if `raw`.  Or, where there are `places`, these entries
   of u, `of_u` of them, and then of v, as the loop has them. */
typedef struct {
    const integer *at, *places;
    double *u, *v, *impulse, *sums;
    integer count, raw, size, behind, walls, entries, of_u;
} wanted;

static void copy(double *to, const double *from, integer n) { memcpy(to, from, n * sizeof *to); }

static void take(const loop *l, wanted *w, int is_shown)
{
    if (w->places)
        for (integer j = 0; j < w->entries; j++)
            *w->u++ = j < w->of_u ? l->u[w->places[j]] : l->v[w->places[j]];
    else {
        const double *v = is_shown && !w->raw ? l->shown_v : l->v;
        copy(w->u, is_shown && !w->raw ? l->shown_u : l->u, w->size);
        copy(w->v, v, w->size);
        w->u += w->size, w->v += w->size;
        if (w->walls) copy(w->impulse, v + w->behind, w->walls), w->impulse += w->walls;
        if (w->sums) copy(w->sums, l->sums, l->sum_count), w->sums += l->sum_count;
    }
    w->at++, w->count--;
}

/* Go from step `done` to `end`, which is shown; whether the loop had to stop. */
integer go(const loop *l, integer done, integer end, wanted *each, integer count)
{
    while (done < end) {
        integer next = end, is_seen = 0;
        for (integer k = 0; k < count; k++)
            if (each[k].count && *each[k].at < next) next = *each[k].at;
        if (l->advance(l->scene, l->method, next - done, done > 0)) return 1;
        done = next;
        for (integer k = 0; k < count; k++)
            is_seen |= each[k].count && *each[k].at == done && !each[k].raw;
        if (is_seen || done == end) {
            copy(l->shown_u, l->u, l->size);
            copy(l->shown_v, l->v, l->size);
            if (l->show && l->show(l->scene, l->method, l->shown_u, l->shown_v)) return 1;
        }
        for (integer k = 0; k < count; k++)
            while (each[k].count && *each[k].at == done) take(l, each + k, is_seen);
    }
    return 0;
}
