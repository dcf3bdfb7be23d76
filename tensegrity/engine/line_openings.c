/* Overlaps of a chain's contacts, and what its sites get where one opens or closes. */

static void overlaps(const scene *c, const openings *o, const real *restrict u,
                     const real *restrict v, real *restrict w, real *restrict d)
{
    const real dt = *o->dt;
    for (integer start = 0; start < o->count; start += o->bonds) {
        const real *restrict place = o->place + start, *restrict side = o->side + start;
        EACH(o->bonds) {
            w[start + i] = side[i] * ((u[i + LANES] - u[i]) - place[i]);
            d[start + i] = side[i] * dt * (v[i + LANES] - v[i]);
        }
    }
}

static int may_pass(const scene *c, const openings *o)
{
    for (integer s = 0; s < c->runs; s++) {
        const integer start = LANES * c->first[s];
        const integer ranges = c->met_at[s + 1] - c->met_at[s];
        const real *low = c->low + c->met_at[s], *high = c->high + c->met_at[s];
        integer any = 0;
        for (integer k = 0; k < o->count; k += o->bonds) {
            const real *place = o->place + k + start; /* those of one spring are the same */
            if (c->law[s] & 1) EACH(ranges) any |= (low[i] <= place[i]) & (high[i] >= place[i]);
            else EACH(ranges) any |= (low[i] <= *place) & (high[i] >= *place);
        }
        if (any) return 1;
    }
    return 0;
}

static void remember(const scene *c, const openings *o) {} /* a line does not turn */

static real mobility(const scene *c, const openings *o, integer contact, real x)
{
    return c->w[contact % o->bonds] + c->w[contact % o->bonds + LANES];
}

static real swing(const scene *c, const openings *o, integer b, real x) { return 0; }

static void give(const scene *c, const openings *o, integer contact, real w, real x, real total,
                 real moment, real turning)
{
    const integer b = contact % o->bonds;
    const real dt = *o->dt, side = o->side[contact], left = c->w[b], right = c->w[b + LANES];
    const real impulse = dt * side * total;
    real shift = dt * (dt * side * moment + (1 - x) * impulse);
    if (fabs(shift) * (left + right) >= fabs(w)) shift = 0; /* it would change side once more */
    c->v[b] += left * impulse;
    c->v[b + LANES] -= right * impulse;
    c->u[b] += left * shift;
    c->u[b + LANES] -= right * shift;
}
