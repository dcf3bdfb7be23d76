/* A run with its rows: whole steps of any compiled loop, and copies of what is looked at.

   Compiled once for all scenes: it calls the loops of others by their addresses, and knows of
   them only the numbers that they advance.  All in double precision. */

#include <string.h>

typedef long long integer;

/* Steps of a loop: its function, the one or two structures that it takes, the arrays it advances. */
typedef struct {
    void *function, *first, *second;
    double *u, *v;
} task;

typedef struct {
    task begin, step, close, leave; /* `function` 0 where a method has no such part */
    integer size;                   /* numbers in u */
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

/* Go from step `done` to each of `count` others, `at`, and keep the first `sites` numbers of u
   and v there, and the `more` of v from `place` on; of the last one only if `last` is kept too. */
void go(const walk *w, integer done, const integer *at, integer count, integer last,
        integer sites, double *rows_u, double *rows_v, integer place, integer more, double *extra)
{
    const integer size = w->size;
    for (integer k = 0; k < count; k++) {
        if (done == 0 && at[k] > 0 && w->begin.function) {
            bring(w->begin.u, w->step.u, size);
            bring(w->begin.v, w->step.v, size);
            carry_out(&w->begin, 1);
            bring(w->step.u, w->begin.u, size);
            bring(w->step.v, w->begin.v, size);
            done = 1;
        }
        if (at[k] > done) carry_out(&w->step, at[k] - done);
        done = at[k];
        const task *seen = copied(&w->leave, copied(&w->close, &w->step, size), size);
        if (k == count - 1 && !last) return;
        memcpy(rows_u + k * sites, seen->u, sites * sizeof *rows_u);
        memcpy(rows_v + k * sites, seen->v, sites * sizeof *rows_v);
        if (more) memcpy(extra + k * more, seen->v + place, more * sizeof *extra);
    }
}
