/* Lanes: V is LANES numbers, I as many integers of the same size; comparisons give all ones or all zeros. */
#include <stdint.h>

typedef int64_t word;
#if SINGLE
typedef float R;
typedef int32_t N;
#define LIBM(name) __builtin_##name##f
#define X86(bits) __builtin_ia32_vfmaddps##bits
#define FULL 16 /* numbers in the widest register */
#define MAGNITUDE 0x7fffffff
#else
typedef double R;
typedef int64_t N;
#define LIBM(name) __builtin_##name
#define X86(bits) __builtin_ia32_vfmaddpd##bits
#define FULL 8
#define MAGNITUDE 0x7fffffffffffffff
#endif
#ifdef NUMBERS /* of one lane */
typedef R V;
typedef int I; /* a mask: 0 or 1 */
#define S(x) ((V)(x))
#define LANE(x, l) (x)
#else
typedef R V __attribute__((vector_size(LANES * sizeof(R))));
typedef N I __attribute__((vector_size(LANES * sizeof(R))));
#define S(x) ((V){0} + (R)(x))
#define LANE(x, l) (x)[l]
#endif
/* x * y + z in one rounding, where the processor has that: without it compilers would call the C library. */
#if !defined(__FMA__) && !defined(__FP_FAST_FMA)
#define FMA(x, y, z) ((x) * (y) + (z))
#elif defined(NUMBERS)
#define FMA(x, y, z) LIBM(fma)(x, y, z)
#elif defined(__AVX512F__) && !defined(__clang__) && LANES == FULL
#define FMA(x, y, z) X86(512_mask)(x, y, z, -1, 4)
#elif defined(__FMA__) && !defined(__clang__) && 2 * LANES == FULL
#define FMA(x, y, z) X86(256)(x, y, z)
#elif defined(__FMA__) && !defined(__clang__) && 4 * LANES == FULL
#define FMA(x, y, z) X86()(x, y, z)
#else
#define FMA(x, y, z) fma_(x, y, z)
static inline __attribute__((unused)) V fma_(V x, V y, V z) {
  V r;
  for (int l = 0; l < LANES; l++) LANE(r, l) = LIBM(fma)(LANE(x, l), LANE(y, l), LANE(z, l));
  return r;
}
#endif
#define NAN __builtin_nan("")
#define INFINITY __builtin_inf()
#define PREFETCH(place) __builtin_prefetch(place)
#define LOWEST(x) __builtin_ctzll(x) /* of the bits that are set */
#define NOINLINE __attribute__((noinline, unused))
#define API __attribute__((visibility("default")))

/* sqrt, floor and ceil become one instruction; the others call the C library lane by lane. */
#define UNARY(name) \
  static inline __attribute__((unused)) V name##_(V x) { \
    V r; \
    for (int l = 0; l < LANES; l++) LANE(r, l) = LIBM(name)(LANE(x, l)); \
    return r; \
  }
#define BINARY(name) \
  static inline __attribute__((unused)) V name##_(V x, V y) { \
    V r; \
    for (int l = 0; l < LANES; l++) LANE(r, l) = LIBM(name)(LANE(x, l), LANE(y, l)); \
    return r; \
  }
/* The C library finds both together in 0.6 of the time, with the same bits. */
static inline __attribute__((unused)) void sincos_(V x, V *s, V *c) {
  V sine, cosine;
  for (int l = 0; l < LANES; l++) LANE(sine, l) = LIBM(sin)(LANE(x, l)), LANE(cosine, l) = LIBM(cos)(LANE(x, l));
  *s = sine, *c = cosine;
}
UNARY(sqrt) UNARY(floor) UNARY(ceil) UNARY(fabs)
UNARY(exp) UNARY(log) UNARY(sin) UNARY(cos) UNARY(tan) UNARY(asin) UNARY(acos) UNARY(atan) UNARY(erf)
UNARY(sinh) UNARY(cosh) UNARY(tanh) UNARY(asinh) UNARY(acosh) UNARY(atanh) UNARY(log1p) UNARY(expm1)
BINARY(pow) BINARY(fmod) BINARY(remainder) BINARY(copysign) BINARY(atan2) BINARY(hypot)
