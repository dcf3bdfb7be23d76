/* Goes in front of the texts of loops: FLUSH, first in a function, makes numbers below the smallest
   normal one 0 until it returns.  Ahead of a front sites move by such numbers, and each would take
   as long as hundreds of others. */

#if defined(__GNUC__) && defined(__SSE2__)
#include <xmmintrin.h>
typedef unsigned rounding;
static inline rounding flushed(void)
{
    const rounding was = _mm_getcsr();
    if ((was & 0x8040) != 0x8040) _mm_setcsr(was | 0x8040); /* results, and what is read */
    return was;
}
static inline void restored(const rounding *was)
{
    if ((*was & 0x8040) != 0x8040) _mm_setcsr(*was); /* which takes longer than to look */
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
