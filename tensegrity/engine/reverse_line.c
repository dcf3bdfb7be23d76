/* Chains: bond j joins sites j and j + 1.  Loops go on to `room`, a whole number of packs beyond
   the last site, where nothing weighs and nothing pulls. */

#if EXACT
static void place(const scene *c)
{
    const real *restrict u = c->u;
    real *restrict r = c->r;
    EACH(c->room) r[i] = u[i + 1] - u[i];
}

static void gather(const scene *c)
{
    const real *restrict f = c->f;
    real *restrict pull = c->pull;
    EACH(c->room) pull[i] = f[i + 1] - f[i];
}
#endif

/* The numbers one place before those of a pack, of which `before` are as many that come first.
   Read from memory where they were just stored, they would have to be waited for. */
PACKED pack shifted(pack before, pack here)
{
#if WIDE == 8
    return (pack)_mm512_alignr_epi64((__m512i)here, (__m512i)before, WIDE - 1);
#else
    pack y;
    LANES_OF(l) LANE(y, l) = l ? LANE(here, l - 1) : LANE(before, WIDE - 1);
    return y;
#endif
}

/* From the derivatives by the velocities to those by masses, parameters and u. */
static void carry(const scene *c, real a, integer o)
{
    const integer apart = c->apart;
    const real *w = c->w, *vb = c->vb + o * c->entries, *k = c->k, *d = c->d;
    real *ub = c->ub + o * c->entries, *wb = c->wb + o * c->entries;
    real *pb = c->pb + o * c->wanted * apart;
    pack before = wide(0);
    for (integer i = 0; i < c->room; i += WIDE) {
        const pack push = a * load(vb + i);
        const pack bent = push * load(w + i) - a * load(vb + i + 1) * load(w + i + 1);
        const pack back = bent * load(k + i);
        store(wb + i, load(wb + i) + push * load(c->pull + i));
        for (integer m = i; m < i + c->wanted * apart; m += apart)
            store(pb + m, load(pb + m) + bent * load(d + m));
        store(ub + i, load(ub + i) + shifted(before, back) - back);
        before = back;
    }
}

/* The drift of a stage undone, and elongations before it. */
static void undrift(const scene *c, real b)
{
    real *restrict r = c->r, *restrict u = c->u;
    const real *restrict v = c->v;
    EACH(c->room) {
        const real here = u[i] - b * v[i];
        r[i] = u[i + 1] - b * v[i + 1] - here;
        u[i] = here;
    }
}

/* Forces on the sites from tensions, and their kick undone. */
static void unkick(const scene *c, real a)
{
    pack before = wide(0);
    for (integer i = 0; i < c->room; i += WIDE) {
        const pack f = load(c->f + 1 + i), pull = f - shifted(before, f);
        store(c->pull + i, pull);
        store(c->v + i, load(c->v + i) - a * load(c->w + i) * pull);
        before = f;
    }
}
