/* What the functions and the driver are written with, for one thread: a robot in each lane of a warp. */
typedef long long word;
#if SINGLE
typedef float R;
#else
typedef double R;
#endif
typedef R V;
typedef bool I; /* a mask */
#define S(x) ((V)(x))
#define restrict __restrict__
#ifndef NAN
#define NAN __longlong_as_double(0x7ff8000000000000LL)
#define INFINITY __longlong_as_double(0x7ff0000000000000LL)
#endif
