/* Forces of a run of contacts of law number K in a tile, of pairs or with walls: added to the rows
   of both sites, or to those of the site and of the contact with a wall.  Returns whether any is
   not 0.  With a law of both ends (ENDS) the gradient is that by both ends, and instead of
   elongations the ranges of differences of free coordinates and of values of others are noted. */

#ifdef ENDS
#define WAYS (2 * DIM)
#define NOTED DIM
#define EACH_NOTED 0
#else
#define WAYS DIM
#define NOTED 1
#define EACH_NOTED OWNED
#endif

__attribute__((always_inline)) static inline int OF(run)(
    const scene *c, const real *restrict u, integer s, integer t, real *restrict pull,
    const int wall)
{
    pack stored[STORED][ROOM], along[WAYS][ROOM], r[ROOM], f[ROOM], p[PARAMETERS + 1], sum[DIM];
    pack largest = wide(0);
    const integer start = c->entry[s], all = c->entry[s + 1] - start;
    const integer *slice = c->slice + s * (c->tiles + 1) + t;
    const integer each_gap = c->gap_each[s] * GROUP, each_length = c->length_each[s] * GROUP;
    const real *restrict shared = c->shared + s * PARAMETERS, *restrict own = c->own + c->own_at[s];
    const real *restrict places = c->places;
    real *restrict low = c->low + c->range_at[s], *restrict high = c->high + c->range_at[s];
    for (int k = 0; k < PARAMETERS; k++) p[k] = wide(shared[k]);
#if !EACH_NOTED
    low += c->piece * NOTED * GROUP, high += c->piece * NOTED * GROUP;
    pack least[NOTED], most[NOTED];
    for (int k = 0; k < NOTED; k++) least[k] = load(low + k * GROUP), most[k] = load(high + k * GROUP);
#endif
    for (int part = 0; part < GROUP; part += WIDE)
        for (integer q = slice[0], at = c->begin[q]; q < slice[1];) {
            /* Whole slices that fit into the work space, or a part of one that does not. */
            integer last = q;
            while (last < slice[1] && c->begin[last + 1] - at <= ROOM) last++;
            const integer stop = last > q ? c->begin[last] : at + ROOM, to = last + (last == q);
            const integer e = at * GROUP - start + part;
            const integer at_wall = c->normal_at[s] + e * DIM - part * (DIM - 1);
            const real *restrict normals = c->normal + at_wall;
            real *restrict press = c->press + at_wall;
            const real *gaps = c->gap + c->gap_at[s] + c->gap_each[s] * e;
            const real *lengths = c->length + c->length_at[s] + c->length_each[s] * e;
            const int *restrict other = c->other + at * GROUP + part;
            const unsigned char *restrict counts = c->counts + at;
            for (integer z = q, g = 0; z < to; z++) {
                const int *restrict site = c->site + z * GROUP + part;
                const integer end = (c->begin[z + 1] < stop ? c->begin[z + 1] : stop) - at;
                pack here[DIM], moved[DIM];
                columns(places, site, here);
                columns(u, site, moved);
                for (; g < end; g++) {
                    pack x[DIM], y[DIM];
#define CONTACT gaps, each_gap, lengths, each_length, r, along, stored
                    if (wall) {
                        AXES(k) x[k] = load(normals + (g * DIM + k) * GROUP);
                        first_wall(g, x, moved, CONTACT);
                        continue;
                    }
                    columns(u, other + g * GROUP, y);
#ifdef ENDS
                    AXES(k) {
                        const pack lower = free_ends[k] ? y[k] - moved[k] : smaller_of(y[k], moved[k]);
                        const pack upper = free_ends[k] ? lower : larger_of(y[k], moved[k]);
                        least[k] = smaller_of(lower, least[k]), most[k] = larger_of(upper, most[k]);
                    }
                    OF(first_ends)(g, moved, y, p, own + e, all, along, stored);
                    continue;
#endif
                    columns(places, other + g * GROUP, x);
                    AXES(k) y[k] = moved[k] - y[k], x[k] = here[k] - x[k];
#if DIM == 1
                    x[0] = TRUTH(x[0] > wide(0)) - TRUTH(x[0] < wide(0));
#endif
                    first_pair(g, x, y, CONTACT);
                }
            }
#ifdef ENDS
            OF(rest_ends)(stop - at, along, stored);
#else
            (wall ? rest_wall : rest_pair)(stop - at, CONTACT);
#endif
#ifndef ENDS
            if (c->strung[s]) /* the range has the shortest segment, and the means */
                for (integer g = 0; g < stop - at; g++) {
                    const integer entry = start + e + g * GROUP;
                    const pack shortest = load(c->least + entry);
#if EACH_NOTED
                    real *lower = low + e + g * GROUP;
                    store(lower, smaller_of(shortest, load(lower)));
#else
                    *least = smaller_of(shortest, *least);
#endif
                    r[g] = load(c->mean + entry);
                }
#endif
            OF(tension_lanes)(stop - at, r, p, own + e, all, f);
            for (integer z = q, g = 0; z < to; z++) {
                const int *restrict site = c->site + z * GROUP + part;
                const integer end = (c->begin[z + 1] < stop ? c->begin[z + 1] : stop) - at;
                if (at + g == c->begin[z]) AXES(k) sum[k] = wide(0);
                for (; g < end; g++) {
                    const pack tension = counting(counts[g] >> part, f[g]);
                    largest = larger_of(magnitude(tension), largest);
#if EACH_NOTED
                    real *lower = low + e + g * GROUP, *upper = high + e + g * GROUP;
                    store(lower, smaller_of(r[g], load(lower)));
                    store(upper, larger_of(r[g], load(upper)));
#elif NOTED == 1 && !defined(ENDS)
                    *least = smaller_of(r[g], *least), *most = larger_of(r[g], *most);
#endif
                    pack forces[DIM];
                    AXES(k) {
                        forces[k] = along[k][g] * tension;
                        ROUNDED(forces[k])
                        sum[k] -= forces[k];
                    }
#ifdef ENDS
                    AXES(k) {
                        forces[k] = -along[DIM + k][g] * tension;
                        ROUNDED(forces[k])
                    }
#endif
                    if (wall) AXES(k) store(press + (g * DIM + k) * GROUP, forces[k]);
                    else add_rows(pull, other + g * GROUP, forces);
                }
                if (at + end == c->begin[z + 1]) add_rows(pull, site, sum);
            }
            q = last, at = stop;
        }
#if !EACH_NOTED
    for (int k = 0; k < NOTED; k++) store(low + k * GROUP, least[k]), store(high + k * GROUP, most[k]);
#endif
    int felt = 0;
    LANES_OF(l) felt |= LANE(largest, l) > 0;
    return felt;
}

#define CONTACTS(name, wall)                                                                \
    __attribute__((flatten)) static int OF(name)(                                           \
        const scene *c, const real *u, integer s, integer t, real *restrict pull)           \
    {                                                                                       \
        return OF(run)(c, u, s, t, pull, wall);                                             \
    }
CONTACTS(pairs, 0)
CONTACTS(walls, 1)

#undef CONTACT
#undef WAYS
#undef NOTED
#undef EACH_NOTED
