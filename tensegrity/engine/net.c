/* Stages and accelerations of a network; RUNS(X) lists the kinds of runs. */

/* Adds to `force`, which holds the loads. */
static void contacts(const scene *c, const real *u)
{
    for (integer s = 0; s < c->runs; s++)
        switch (c->law[s]) {
#define CASES(K, OWN)                                                                       \
    case 4 * K + OWN: pairs_##K##_##OWN(c, s, u); break;                                    \
    case 4 * K + 2 + OWN: walls_##K##_##OWN(c, s, u); break;
            RUNS(CASES)
        }
}

static void acceleration(const scene *c, const real *restrict u, real *restrict a)
{
    real *restrict force = c->force;
    contacts(c, u);
    EACH(c->rows * DIM) {
        a[i] = c->w[i] * force[i];
        force[i] = c->load[i];
    }
}

static void stage(const scene *c, real a, real b)
{
    real *restrict u = c->u, *restrict v = c->v, *restrict force = c->force;
    const real *restrict w = c->w, *restrict load = c->load;
    const integer moving = c->sites * DIM, all = c->rows * DIM;
    real farthest[GROUP] = {0}, largest = 0;
    contacts(c, u);
    integer q = 0;
    for (; q + GROUP <= moving; q += GROUP)
        WHOLE_GROUP {
            v[q + i] += a * w[q + i] * force[q + i];
            real move = b * v[q + i];
            u[q + i] += move;
            force[q + i] = load[q + i];
            move = fabs(move);
            farthest[i] = move > farthest[i] ? move : farthest[i];
        }
    for (; q < all; q++) {
        v[q] += a * w[q] * force[q];
        real move = b * v[q];
        u[q] += move;
        force[q] = load[q];
        if (q < moving) largest = larger(largest, fabs(move));
    }
    for (int i = 0; i < GROUP; i++) largest = larger(largest, farthest[i]);
    *c->travel += largest;
}
