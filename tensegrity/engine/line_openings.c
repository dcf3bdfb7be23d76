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
