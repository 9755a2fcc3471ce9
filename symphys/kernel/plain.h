/* What the functions and the driver are written with, for one number at a time: plain C99. */
#include <math.h>
#include <stdint.h>

typedef int64_t word;
typedef double R;
typedef double V;
typedef int I; /* a mask: 0 or 1 */
#define LANES 1
#define S(x) ((V)(x))
#define LANE(x, l) (x)
#define NOINLINE
#define API static

#define UNARY(name) static inline V name##_(V x) { return name(x); }
#define BINARY(name) static inline V name##_(V x, V y) { return name(x, y); }
UNARY(sqrt) UNARY(floor) UNARY(ceil)
UNARY(exp) UNARY(log) UNARY(sin) UNARY(cos) UNARY(tan) UNARY(asin) UNARY(acos) UNARY(atan) UNARY(erf)
UNARY(sinh) UNARY(cosh) UNARY(tanh) UNARY(asinh) UNARY(acosh) UNARY(atanh) UNARY(log1p) UNARY(expm1)
BINARY(pow) BINARY(fmod) BINARY(remainder) BINARY(copysign) BINARY(atan2) BINARY(hypot)
