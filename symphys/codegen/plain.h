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
#define FRESH 1 /* memory is the caller's, and new to every evaluation */
