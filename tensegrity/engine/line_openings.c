/* Overlaps of a chain's contacts, and what its sites get where one opens or closes. */

static void overlaps(const scene *c, const openings *o, const real *restrict u,
                     const real *restrict v, real *restrict w, real *restrict d)
{
    const real *restrict place = o->place, *restrict side = o->side, dt = *o->dt;
    EACH(o->count) {
        w[i] = side[i] * ((u[i + LANES] - u[i]) - place[i]);
        d[i] = side[i] * dt * (v[i + LANES] - v[i]);
    }
}

static int may_pass(const scene *c, const openings *o)
{
    for (integer s = 0; s < c->runs; s++) {
        const integer start = LANES * c->first[s];
        const integer ranges = (c->range_at[s + 1] - c->range_at[s]) / 2;
        const real *low = c->range + c->range_at[s], *high = low + ranges;
        const real *place = o->place + start; /* one spring opens at one place */
        integer any = 0;
        if (c->law[s] & 1) EACH(ranges) any |= (low[i] <= place[i]) & (high[i] >= place[i]);
        else EACH(ranges) any |= (low[i] <= *place) & (high[i] >= *place);
        if (any) return 1;
    }
    return 0;
}

static void remember(const scene *c, const openings *o) {} /* a line does not turn */

static real swing(const scene *c, const openings *o, integer b, real x) { return 0; }

static void give(const scene *c, const openings *o, integer b, real w, real x, real total,
                 real moment, real turning)
{
    const real dt = *o->dt, left = c->w[b], right = c->w[b + LANES];
    const real impulse = dt * o->side[b] * total;
    real shift = dt * (dt * o->side[b] * moment + (1 - x) * impulse);
    if (fabs(shift) * (left + right) >= fabs(w)) shift = 0; /* it would change side once more */
    c->v[b] += left * impulse;
    c->v[b + LANES] -= right * impulse;
    c->u[b] += left * shift;
    c->u[b + LANES] -= right * shift;
}
