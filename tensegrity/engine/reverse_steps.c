/* Stages and steps backwards, one text for every scene. */

static void reverse_stage(const scene *c, real a, real b)
{
#if EXACT
    real *u = c->u, *v = c->v, *turn = c->turn; /* those called have them too */
    if (b != 0) {
        moves_of_u(c, b, v, turn);
        EACH(c->room) u[i] -= turn[i];
    }
    place(c);
#else
    undrift(c, b);
#endif
    for (integer o = 0; o < c->objectives; o++) {
        real *ub = c->ub + o * c->entries, *vb = c->vb + o * c->entries;
        EACH(c->room) vb[i] += b * ub[i];
    }
    if (a == 0) return;
    laws(c);
#if EXACT
    gather(c);
    moves_of_v(c, a, c->w, c->pull, turn);
    EACH(c->room) v[i] -= turn[i];
#else
    unkick(c, a);
#endif
    for (integer o = 0; o < c->objectives; o++) carry(c, a, o);
}

/* Add what the objectives have to do with the state after step number k. */
void sow(const scene *c, const seeds *s, integer k)
{
    if (k < s->begin || k > s->end) return;
    for (integer o = 0; o < c->objectives; o++) {
        const real *row = s->rows + (o * (s->end - s->begin + 1) + k - s->begin) * s->count;
        for (integer j = 0; j < s->of_u; j++) c->ub[o * c->entries + s->places[j]] += row[j];
        for (integer j = s->of_u; j < s->count; j++)
            c->vb[o * c->entries + s->places[j]] += row[j];
    }
}

/* Undo `steps` steps, the last of them number `last`, as `advance` did them. */
void reverse(const scene *c, integer steps, integer opened, integer last, const seeds *s)
{
    FLUSH
    for (integer k = steps - 1; k >= 0; k--) {
        for (integer i = c->stages - 1; i >= 0; i--)
            reverse_stage(c, kick(c, i, k > 0 || opened), c->drifts[i]);
        if (s) sow(c, s, last - (steps - k));
    }
}

#if EXACT /* for `steps.c` */
static void stage(const scene *c, real a, real b)
{
    const integer n = c->room;
    real *u = c->u, *v = c->v, *turn = c->turn;
    if (a != 0) {
        place(c);
        real *low = c->low, *high = c->high, *r = c->r;
        EACH(c->bonds) {
            low[i] = r[i] < low[i] ? r[i] : low[i];
            high[i] = r[i] > high[i] ? r[i] : high[i];
        }
        tensions(c);
        gather(c);
        moves_of_v(c, a, c->w, c->pull, turn);
        EACH(n) v[i] += turn[i];
    }
    if (b == 0) return;
    real largest = 0;
    moves_of_u(c, b, v, turn);
    for (integer i = 0; i < c->moving; i++) largest = larger(largest, fabs(turn[i]));
    EACH(n) u[i] += turn[i];
    *c->travel += largest;
}
#endif

#define EVALUATE_CASE(K, OWN)                                                               \
    if (law == K && !OWN) rows_##K##_##OWN(n, apart, r, f, k, d, p, p);

/* The same for n elongations of a bond of one law, with its parameters p; rows `apart` from each
   other, which leave room for a pack behind the last. */
void evaluate(integer law, integer n, integer apart, const real *p, const real *r, real *f, real *k, real *d)
{
    RUNS(EVALUATE_CASE)
}
