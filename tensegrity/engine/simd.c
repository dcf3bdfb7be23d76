/* SIMD vectors of numbers, `pack`, and the operations that laws and geometry need.

   With AVX-512, roots and quotients start from the estimates of the processor, which are good to 14
   bits.  A root takes one step of fourth order, 1/sqrt(1 - e) to the third power of e < 2^-13; a
   quotient two of second order, the last with the remainder.  Other processors have no estimates
   for doubles, and their roots and divisions are used. */

#if defined(EXTENDED)
#define WIDE 1
#elif defined(__AVX512F__)
#define WIDE 8
#elif defined(__AVX__)
#define WIDE 4
#else
#define WIDE 2
#endif
#if defined(__AVX__) && WIDE > 1
#include <immintrin.h>
#endif

#define GROUP 8 /* contacts of a group; a multiple of WIDE */
#define BLOCK 64 /* bonds of a chain that fit into the nearest cache */
#define PACKED static inline __attribute__((always_inline))
#define LANES_OF(l) for (int l = 0; l < WIDE; l++)

#if WIDE == 1
typedef real pack;
typedef integer mask;
#define LANE(x, l) (*(&(x) + (l)))
#define TRUTH(c) ((real)(c))
#define SELECT(c, a, b) ((c) ? (a) : (b))
PACKED pack wide(real x) { return x; }
PACKED mask wide_integer(integer n) { return n; }
PACKED pack magnitude(pack x) { return fabs(x); }
#else
typedef real pack __attribute__((vector_size(8 * WIDE)));
typedef integer mask __attribute__((vector_size(8 * WIDE)));
#define LANE(x, l) ((x)[l])
#define SELECT(c, a, b) ((pack)(((mask)(c) & (mask)(a)) | (~(mask)(c) & (mask)(b))))
#define TRUTH(c) ((pack)((mask)(c) & (mask)wide(1)))
PACKED pack wide(real x)
{
#if WIDE == 8
    return _mm512_set1_pd(x);
#elif WIDE == 4
    return _mm256_set1_pd(x);
#else
    return (pack){x, x};
#endif
}
PACKED mask wide_integer(integer n)
{
    mask y;
    LANES_OF(l) y[l] = n;
    return y;
}
PACKED pack magnitude(pack x) { return (pack)((mask)x & wide_integer(0x7fffffffffffffff)); }
#endif

PACKED pack load(const real *at)
{
    pack y;
    __builtin_memcpy(&y, at, sizeof y);
    return y;
}
PACKED mask load_integers(const integer *at)
{
    mask y;
    __builtin_memcpy(&y, at, sizeof y);
    return y;
}
PACKED void store(real *at, pack x) { __builtin_memcpy(at, &x, sizeof x); }
typedef pack loose __attribute__((aligned(8), may_alias));
#define INTO(at) (*(loose *)(at)) /* a vector at any address */

#if WIDE == 8
PACKED pack larger_of(pack x, pack y) { return _mm512_max_pd(x, y); }
PACKED pack smaller_of(pack x, pack y) { return _mm512_min_pd(x, y); }
/* Zero where `c` does not hold. */
PACKED pack only(mask c, pack x) { return _mm512_maskz_mov_pd(_mm512_movepi64_mask((__m512i)c), x); }
#define ESTIMATE(x) _mm512_rsqrt14_pd(x)
#define SERIES(e) (wide(0.5) + (e) * (wide(0.375) + (e) * 0.3125))
PACKED pack root(pack x)
{
    /* Finite at 0, whatever its sign, nan below. */
    const pack y = _mm512_min_pd(wide(1e300), ESTIMATE(x + wide(0)));
    const pack h = x * y, e = 1 - h * y;
    return h + h * e * SERIES(e);
}
PACKED pack root_of_positive(pack x)
{
    const pack y = ESTIMATE(x), h = x * y, e = 1 - h * y;
    return h + h * e * SERIES(e);
}
PACKED pack if_less(pack a, pack b, pack x)
{
    return _mm512_maskz_mov_pd(_mm512_cmp_pd_mask(a, b, _CMP_LT_OQ), x);
}
PACKED pack if_at_most(pack a, pack b, pack x)
{
    return _mm512_maskz_mov_pd(_mm512_cmp_pd_mask(a, b, _CMP_LE_OQ), x);
}
/* Zero where the bit of a lane is not set. */
PACKED pack counting(unsigned bits, pack x) { return _mm512_maskz_mov_pd(bits, x); }
PACKED pack inverse_root(pack x)
{
    const pack y = ESTIMATE(x), e = 1 - x * y * y;
    return y + y * e * SERIES(e);
}
PACKED pack quotient(pack x, pack y)
{
    const pack z = _mm512_rcp14_pd(y), z2 = z + z * (1 - y * z), q = x * z2;
    return q + (x - y * q) * z2;
}
PACKED pack root_by(pack x, pack inverse)
{
    return _mm512_maskz_mul_pd(_mm512_cmp_pd_mask(x, wide(0), _CMP_NEQ_UQ), x, inverse);
}
#else
#if WIDE == 4
PACKED pack larger_of(pack x, pack y) { return _mm256_max_pd(x, y); }
PACKED pack smaller_of(pack x, pack y) { return _mm256_min_pd(x, y); }
#else
PACKED pack larger_of(pack x, pack y) { return SELECT(x > y, x, y); }
PACKED pack smaller_of(pack x, pack y) { return SELECT(x < y, x, y); }
#endif
PACKED pack only(mask c, pack x) { return SELECT(c, x, wide(0)); }
PACKED pack root(pack x)
{
#if WIDE == 4
    return _mm256_sqrt_pd(x);
#else
    pack y;
    LANES_OF(l) LANE(y, l) = sqrt(LANE(x, l));
    return y;
#endif
}
PACKED pack root_of_positive(pack x) { return root(x); }
PACKED pack if_less(pack a, pack b, pack x) { return only((mask)(a < b), x); }
PACKED pack if_at_most(pack a, pack b, pack x) { return only((mask)(a <= b), x); }
PACKED pack counting(unsigned bits, pack x)
{
    const integer each[] = {1, 2, 4, 8};
    return only((wide_integer(bits) & load_integers(each)) != wide_integer(0), x);
}
PACKED pack inverse_root(pack x) { return 1 / root(x); }
PACKED pack root_by(pack x, pack inverse) { return root(x); }
PACKED pack quotient(pack x, pack y) { return x / y; }
#endif

/* Functions without a SIMD instruction. */
#define ONE_BY_ONE(y, f, ...) LANES_OF(l) LANE(y, l) = f(__VA_ARGS__);

/* Sine and cosine to 1.1e-16: x less the nearest multiple n of pi/2, in three parts of which n times
   the first two are exact, then the series of both by the minimax polynomials of fdlibm (Sun, 1993;
   K. C. Ng).  The last bits of n, as it is rounded by adding 1.5 2^52, tell the quadrant.  Where an
   argument is so large that n times the parts are not exact, the library takes over. */
PACKED void sine_cosine(pack x, pack *sine, pack *cosine)
{
#if WIDE > 1
    const pack whole = wide(6755399441055744.0), turns = x * 0.63661977236758134308 + whole;
    const pack n = turns - whole;
    const pack r = ((x - n * 1.57079632673412561417) - n * 6.07710050630396597660e-11) -
                   n * 2.02226624879595063154e-21;
    const pack z = r * r;
    const pack s = r + r * z * (-1.66666666666666324348e-1 + z * (8.33333333332248946124e-3 +
        z * (-1.98412698298579493134e-4 + z * (2.75573137070700676789e-6 +
        z * (-2.50507602534068634195e-8 + z * 1.58969099521155010221e-10)))));
    const pack c = 1 - (0.5 * z - z * z * (4.16666666666666019037e-2 + z * (-1.38888888888741095749e-3 +
        z * (2.48015872894767294178e-5 + z * (-2.75573143513906633035e-7 +
        z * (2.08757232129817482790e-9 - z * 1.13596475577881948265e-11))))));
    const mask quarter = (mask)turns, odd = -(quarter & wide_integer(1));
    const mask two = quarter << 62, three = (quarter + wide_integer(1)) << 62;
    const mask sign = wide_integer(1) << 63;
    *sine = (pack)((mask)SELECT(odd, c, s) ^ (two & sign));
    *cosine = (pack)((mask)SELECT(odd, s, c) ^ (three & sign));
    integer near = 1;
    LANES_OF(l) near &= fabs(x[l]) < 1e6;
    if (near) return;
#endif
    ONE_BY_ONE(*sine, sin, LANE(x, l))
    ONE_BY_ONE(*cosine, cos, LANE(x, l))
}

/* Rounds a product before it is added: contracted with the sum, equal and opposite forces would
   differ in their last bit, and momentum would not be conserved.  gcc rounds a product that is also
   stored; other compilers need not. */
#if WIDE == 8
#define ROUNDED(x) __asm__("" : "+v"(x));
#elif WIDE == 4
#define ROUNDED(x) __asm__("" : "+x"(x));
#else
#define ROUNDED(x) __asm__("" : "+m"(x));
#endif

/* Vectors stored between two passes, which fit into the nearest cache; a network stores more
   numbers for each, and a chain needs at least those of a block. */
#ifdef DIM
#define ROOM 12
#else
#define ROOM (WIDE < 4 ? 64 / WIDE : 24)
#endif

#ifdef DIM
/* The coordinates of sites.  Up to four numbers are read: there is a row after the last one. */
PACKED void columns(const real *base, const int *at, pack *out)
{
#if WIDE == 8 && DIM > 1
#define TWO(i, j)                                                                           \
    _mm512_mask_broadcast_f64x4(                                                            \
        _mm512_castpd256_pd512(_mm256_loadu_pd(base + DIM * at[i])), 0xf0, _mm256_loadu_pd(base + DIM * at[j]))
    const __m512d a = TWO(0, 2), b = TWO(1, 3), c = TWO(4, 6), d = TWO(5, 7);
    const __m512d ab = _mm512_unpacklo_pd(a, b), cd = _mm512_unpacklo_pd(c, d);
    out[0] = _mm512_shuffle_f64x2(ab, cd, 0x88);
    out[1] = _mm512_shuffle_f64x2(_mm512_unpackhi_pd(a, b), _mm512_unpackhi_pd(c, d), 0x88);
#if DIM > 2
    out[2] = _mm512_shuffle_f64x2(ab, cd, 0xdd);
#endif
#elif WIDE == 4 && DIM > 1
#define TWO(i, j, k)                                                                        \
    _mm256_insertf128_pd(                                                                   \
        _mm256_castpd128_pd256(_mm_loadu_pd(base + DIM * at[i] + k)), _mm_loadu_pd(base + DIM * at[j] + k), 1)
    const __m256d a = TWO(0, 2, 0), b = TWO(1, 3, 0);
    out[0] = _mm256_unpacklo_pd(a, b);
    out[1] = _mm256_unpackhi_pd(a, b);
#if DIM > 2
    out[2] = _mm256_unpacklo_pd(TWO(0, 2, 2), TWO(1, 3, 2));
#endif
#else
    for (int k = 0; k < DIM; k++) LANES_OF(l) LANE(out[k], l) = base[DIM * at[l] + k];
#endif
#undef TWO
}

/* Numbers in a site's row of sums, padded to a register in three dimensions. */
#define ROW (DIM == 3 ? 4 : DIM)

#if WIDE >= 4 && DIM == 3
typedef __m256d row;
#define load_row _mm256_loadu_pd
#define store_row _mm256_storeu_pd
#elif WIDE >= 4 && DIM == 2
typedef __m128d row;
#define load_row _mm_loadu_pd
#define store_row _mm_storeu_pd
#else
typedef struct {
    real x[ROW];
} row;
PACKED row load_row(const real *at)
{
    row y;
    for (int k = 0; k < ROW; k++) y.x[k] = at[k];
    return y;
}
PACKED void store_row(real *at, row y)
{
    for (int k = 0; k < ROW; k++) at[k] = y.x[k];
}
#endif
PACKED row sum_of(row x, row y)
{
#if WIDE >= 4 && DIM > 1
    return x + y;
#else
    for (int k = 0; k < ROW; k++) x.x[k] += y.x[k];
    return x;
#endif
}

/* The lanes of packs as rows. */
PACKED void rows_of(const pack *f, row *out)
{
#if WIDE == 8 && DIM == 3
    const __m512i near = {0, 1, 8, 9, 2, 3, 10, 11}, far = {4, 5, 12, 13, 6, 7, 14, 15};
    const __m512d a = _mm512_unpacklo_pd(f[0], f[1]), b = _mm512_unpackhi_pd(f[0], f[1]);
    const __m512d c = _mm512_maskz_mov_pd(0x55, f[2]), d = _mm512_maskz_permute_pd(0x55, f[2], 0xff);
    const __m512d two[4] = {
        _mm512_permutex2var_pd(a, near, c), _mm512_permutex2var_pd(b, near, d),
        _mm512_permutex2var_pd(a, far, c), _mm512_permutex2var_pd(b, far, d)};
    for (int k = 0; k < 2; k++) {
        out[k] = _mm512_castpd512_pd256(two[k]), out[4 + k] = _mm512_castpd512_pd256(two[2 + k]);
        out[2 + k] = _mm512_extractf64x4_pd(two[k], 1);
        out[6 + k] = _mm512_extractf64x4_pd(two[2 + k], 1);
    }
#elif WIDE == 8 && DIM == 2
    const __m512d a = _mm512_unpacklo_pd(f[0], f[1]), b = _mm512_unpackhi_pd(f[0], f[1]);
    out[0] = _mm512_extractf64x2_pd(a, 0), out[1] = _mm512_extractf64x2_pd(b, 0);
    out[2] = _mm512_extractf64x2_pd(a, 1), out[3] = _mm512_extractf64x2_pd(b, 1);
    out[4] = _mm512_extractf64x2_pd(a, 2), out[5] = _mm512_extractf64x2_pd(b, 2);
    out[6] = _mm512_extractf64x2_pd(a, 3), out[7] = _mm512_extractf64x2_pd(b, 3);
#elif WIDE == 4 && DIM == 3
    const __m256d none = _mm256_setzero_pd();
    const __m256d a = _mm256_unpacklo_pd(f[0], f[1]), b = _mm256_unpackhi_pd(f[0], f[1]);
    const __m256d c = _mm256_unpacklo_pd(f[2], none), d = _mm256_unpackhi_pd(f[2], none);
    out[0] = _mm256_permute2f128_pd(a, c, 0x20), out[1] = _mm256_permute2f128_pd(b, d, 0x20);
    out[2] = _mm256_permute2f128_pd(a, c, 0x31), out[3] = _mm256_permute2f128_pd(b, d, 0x31);
#elif WIDE == 4 && DIM == 2
    const __m256d a = _mm256_unpacklo_pd(f[0], f[1]), b = _mm256_unpackhi_pd(f[0], f[1]);
    out[0] = _mm256_extractf128_pd(a, 0), out[1] = _mm256_extractf128_pd(b, 0);
    out[2] = _mm256_extractf128_pd(a, 1), out[3] = _mm256_extractf128_pd(b, 1);
#else
    LANES_OF(l) for (int k = 0; k < ROW; k++) out[l].x[k] = k < DIM ? LANE(f[k], l) : 0;
#endif
}

/* The lanes of packs added to rows `at` of `to`, one by one: several may be the same. */
PACKED void add_rows(real *to, const int *at, const pack *f)
{
    row rows[WIDE];
    rows_of(f, rows);
    LANES_OF(l) store_row(to + at[l] * ROW, sum_of(load_row(to + at[l] * ROW), rows[l]));
}

/* Rows of WIDE sites without padding. */
PACKED void squeezed(const real *rows, pack *out)
{
#if DIM < 3
    for (int k = 0; k < DIM; k++) out[k] = load(rows + k * WIDE);
#elif WIDE == 8
    const pack a = load(rows), b = load(rows + 8), c = load(rows + 16), d = load(rows + 24);
    out[0] = _mm512_permutex2var_pd(a, (__m512i){0, 1, 2, 4, 5, 6, 8, 9}, b);
    out[1] = _mm512_permutex2var_pd(b, (__m512i){2, 4, 5, 6, 8, 9, 10, 12}, c);
    out[2] = _mm512_permutex2var_pd(c, (__m512i){5, 6, 8, 9, 10, 12, 13, 14}, d);
#elif WIDE == 4 && defined(__AVX2__)
    const pack a = load(rows), b = load(rows + 4), c = load(rows + 8), d = load(rows + 12);
    out[0] = _mm256_blend_pd(a, _mm256_permute4x64_pd(b, 0x00), 8);
    out[1] = _mm256_permute2f128_pd(_mm256_permute4x64_pd(b, 0x09), c, 0x20);
    out[2] = _mm256_blend_pd(_mm256_permute4x64_pd(d, 0x90), _mm256_permute4x64_pd(c, 0x02), 1);
#else
    for (int n = 0; n < DIM * WIDE; n++)
        LANE(out[n / WIDE], n % WIDE) = rows[n / DIM * ROW + n % DIM];
#endif
}
#endif
