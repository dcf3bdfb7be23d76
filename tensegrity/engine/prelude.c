/* Precedes all C text, also that which CasADi generates, so that the latter is used unchanged.

   Compilers do not vectorise the library's pow, fmax and fmin: powers with a constant exponent
   that is a multiple of 1/4 become products and square roots (decided after inlining), and the
   extrema become plain comparisons. */

#ifdef EXTENDED /* the same text in extended precision is the reference of the tests */
#include <tgmath.h>
#define real long double
#else
#include <math.h>
#define real double
#endif
#define casadi_real real
#define CASADI_SYMBOL_EXPORT static /* no second copy of each function for external callers */
typedef long long integer;

static inline real library_power(real x, real y) { return pow(x, y); }

static inline __attribute__((always_inline)) real power(real x, real y)
{
    real quarters = 4 * y;
    if (!__builtin_constant_p(y) || quarters != (int)quarters || y < 0 || y > 8)
        return library_power(x, y);
    int n = (int)quarters;
    real half = n % 4 ? sqrt(x) : x, result = 1;
    if (n % 4 >= 2) result *= half;
    if (n % 2) result *= sqrt(half);
    for (int i = 0; i < n / 4; i++) result *= x;
    return result;
}

static inline real larger(real x, real y) { return x > y ? x : y; }
static inline real smaller(real x, real y) { return x < y ? x : y; }

#undef pow
#undef fmax
#undef fmin
#define pow power
#define fmax larger
#define fmin smaller

/* Operations of `inertia.RowOperations` on rows of `stride` numbers, of which the first `dim` count:
   from forces to those after which each entry has the mass 1/w of its own. */
static inline void row_operations(real *restrict rows, integer stride, integer count,
                                  const integer *restrict at, const real *restrict factor,
                                  const int dim)
{
    for (integer k = 0; k < count; k++) {
        real *to = rows + at[2 * k] * stride;
        const real *from = rows + at[2 * k + 1] * stride;
        for (int q = 0; q < dim; q++) to[q] -= factor[k * dim + q] * from[q];
    }
}
#define COUPLE(c, rows, stride)                                                             \
    row_operations(rows, stride, (c)->couplings, (c)->coupled, (c)->coupling, DIM);

#define EACH(n) _Pragma("GCC ivdep") for (integer i = 0; i < (n); i++)

/* Names defined by the text of a law, for law number K and a kind of run. */
#define PASTED(a, b) a##_##b
#define PASTE(a, b) PASTED(a, b)
#define LAW(name) PASTE(name, K)
#define OF(name) PASTE(LAW(name), OWNED)

/* The kick of stage i of a step: the first includes the closing kick of the step before, where it
   comes `after` one. */
#define KICK(c, i, after)                                                                   \
    ((c)->kicks[i] + ((after) && (i) == 0 && (c)->closing ? (c)->kicks[(c)->stages] : 0))

/* FLUSH, first in a function, replaces subnormal numbers by 0 until the function returns.  Sites
   ahead of a wave front move by such numbers, whose arithmetic is hundreds of times slower. */

#if defined(__GNUC__) && defined(__SSE2__)
typedef unsigned rounding;
static inline rounding flushed(void)
{
    const rounding was = __builtin_ia32_stmxcsr();
    if ((was & 0x8040) != 0x8040) __builtin_ia32_ldmxcsr(was | 0x8040); /* results and operands */
    return was;
}
static inline void restored(const rounding *was)
{
    if ((*was & 0x8040) != 0x8040) __builtin_ia32_ldmxcsr(*was); /* slower than the comparison */
}
#elif defined(__GNUC__) && defined(__aarch64__)
typedef unsigned long rounding;
static inline rounding flushed(void)
{
    rounding was;
    __asm__ volatile("mrs %0, fpcr" : "=r"(was));
    __asm__ volatile("msr fpcr, %0" : : "r"(was | 1ul << 24));
    return was;
}
static inline void restored(const rounding *was)
{
    __asm__ volatile("msr fpcr, %0" : : "r"(*was));
}
#endif

#if defined(__GNUC__) && (defined(__SSE2__) || defined(__aarch64__))
#define FLUSH __attribute__((cleanup(restored))) const rounding was = flushed();
#else
#define FLUSH
#endif

#define LAST_STEP 1e-9
static inline real cubic(const real *p, real x) { return p[0] + x * (p[1] + x * (p[2] + x * p[3])); }
static inline real incline(const real *p, real x) { return p[1] + x * (2 * p[2] + x * 3 * p[3]); }

/* The root of a cubic between two places with different signs: Newton's method from the root of the
   chord; a last step below LAST_STEP leaves an error of its square. */
static inline real root_between(const real *p, real low, real high)
{
    const real first = cubic(p, low), last = cubic(p, high);
    const int below = first > 0;
    real x = low + (high - low) * (first / (first - last));
    if (!(x > low && x < high)) x = (low + high) / 2;
    for (int k = 0; k < 60; k++) {
        const real y = cubic(p, x), rate = incline(p, x);
        if ((y > 0) == below) low = x;
        else high = x;
        const real next = rate != 0 ? x - y / rate : low;
        const int inside = next >= low && next <= high;
        if (inside && fabs(next - x) <= LAST_STEP) return next;
        x = inside && next != low && next != high ? next : (low + high) / 2;
        if (high - low <= 1e-16) break;
    }
    return x;
}
