/* Forces of a run of contacts of law number K on the sites of a tile, of pairs or with walls. */

__attribute__((always_inline)) static inline void OF(run)(
    const scene *c, const real *restrict u, integer s, integer t, real *restrict pull,
    const int wall)
{
    pack d[DIM][ROOM], w[DIM][ROOM], along[DIM][ROOM], r[ROOM], f[ROOM], p[PARAMETERS + 1];
    const integer start = c->entry[s], all = c->entry[s + 1] - start;
    const integer *slice = c->slice + s * (c->tiles + 1) + t;
    const integer each_gap = c->gap_each[s], each_length = c->length_each[s];
    const real *restrict shared = c->shared + s * PARAMETERS, *restrict own = c->own + c->own_at[s];
    const real *restrict gaps = c->gap + c->gap_at[s];
    const real *restrict lengths = c->length + c->length_at[s];
    const real *restrict places = c->places;
    real *restrict held =
        c->store + (c->piece * c->room + c->held[s * c->tiles + t]) * GROUP * DIM;
    real *restrict low = c->low + c->met_at[s], *restrict high = c->high + c->met_at[s];
    for (int k = 0; k < PARAMETERS; k++) p[k] = wide(shared[k]);
#if !OWNED
    low += c->piece * c->runs * GROUP, high += c->piece * c->runs * GROUP;
    pack least = load(low), most = load(high);
#endif
    const integer begin = c->begin[slice[0]];
    for (integer q = slice[0], at = begin; q < slice[1];) {
        /* Whole slices that find room, or a part of one that does not. */
        integer last = q;
        while (last < slice[1] && c->begin[last + 1] - at <= ROOM) last++;
        const integer stop = last > q ? c->begin[last] : at + ROOM, to = last + (last == q);
        for (int part = 0; part < GROUP; part += WIDE) {
            const integer e = at * GROUP - start + part;
            const real *restrict normals = c->normal + c->normal_at[s] - part * (DIM - 1);
            const int *restrict other = c->other + at * GROUP + part;
            for (integer z = q, g = 0; z < to; z++) {
                const int *restrict site = c->site + z * GROUP + part;
                const integer end = (c->begin[z + 1] < stop ? c->begin[z + 1] : stop) - at;
                pack here[DIM], moved[DIM];
                columns(places, DIM, site, here);
                columns(u, DIM, site, moved);
                for (; g < end; g++) {
                    pack x[DIM], y[DIM];
                    if (wall) {
                        AXES(k) d[k][g] = load(normals + (e + g * GROUP) * DIM + k * GROUP);
                        AXES(k) w[k][g] = moved[k];
                        continue;
                    }
                    columns(places, DIM, other + g * GROUP, x);
                    columns(u, DIM, other + g * GROUP, y);
                    AXES(k) w[k][g] = y[k] - moved[k], x[k] -= here[k];
#if DIM == 1
                    x[0] = TRUTH(x[0] > wide(0)) - TRUTH(x[0] < wide(0));
#endif
                    AXES(k) d[k][g] = x[k];
                }
            }
            if (each_gap || each_length)
                (wall ? wall_lanes : pair_lanes)(
                    stop - at, d, w, gaps + e * each_gap, each_gap * GROUP,
                    lengths + e * each_length, each_length * GROUP, r, along);
            else
                (wall ? wall_even : pair_even)(
                    stop - at, d, w, load(gaps), load(lengths), r, along);
            OF(tension_lanes)(stop - at, r, p, own + e, all, f);
            for (integer z = q, g = 0; z < to; z++) {
                const int *restrict site = c->site + z * GROUP + part;
                const integer end = (c->begin[z + 1] < stop ? c->begin[z + 1] : stop) - at;
                const mask depth = load_integers(c->depth + z * GROUP + part);
                mask place = wide_integer(at + g - c->begin[z]);
                pack sum[DIM];
                AXES(k) sum[k] = wide(0);
                for (; g < end; g++) {
                    const pack tension = counting(place, depth, f[g]);
                    place += wide_integer(1);
#if OWNED
                    real *lower = low + e + g * GROUP, *upper = high + e + g * GROUP;
                    store(lower, smaller_of(r[g], load(lower)));
                    store(upper, larger_of(r[g], load(upper)));
#else
                    least = smaller_of(r[g], least), most = larger_of(r[g], most);
#endif
                    pack forces[DIM];
                    AXES(k) {
                        pack force = along[k][g] * tension;
                        ROUNDED(force)
                        sum[k] = wall ? sum[k] - force : sum[k] + force;
                        forces[k] = force;
                    }
                    if (wall) add_rows(c->press, other + g * GROUP, forces);
                    else
                        AXES(k) store(held + ((at + g - begin) * DIM + k) * GROUP + part, forces[k]);
                }
                add_rows(pull - t * TILE * ROW, site, sum);
            }
        }
        q = last, at = stop;
    }
#if !OWNED
    store(low, least), store(high, most);
#endif
}

__attribute__((flatten)) static void OF(pairs)(
    const scene *c, const real *u, integer s, integer t, real *restrict pull)
{
    OF(run)(c, u, s, t, pull, 0);
}

__attribute__((flatten)) static void OF(walls)(
    const scene *c, const real *u, integer s, integer t, real *restrict pull)
{
    OF(run)(c, u, s, t, pull, 1);
}

#undef EACH_P
