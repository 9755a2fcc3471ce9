/* CUDA's words on a processor: a block's threads are fibers that change at __syncthreads and __any_sync. */
#include <cmath>
#include <cstdint>

#define __global__
#define __device__
#define __noinline__ __attribute__((noinline))
#define __forceinline__ inline
#define __launch_bounds__(count)

struct Index { unsigned x, y; };
extern Index threadIdx, blockIdx;
void __syncthreads();
int __any_sync(unsigned mask, int predicate);
using std::acos, std::acosh, std::asin, std::asinh, std::atan, std::atan2, std::atanh, std::ceil, std::copysign, std::cos,
    std::cosh, std::erf, std::exp, std::expm1, std::fabs, std::floor, std::fmod, std::hypot, std::log, std::log1p, std::pow,
    std::remainder, std::sin, std::sinh, std::sqrt, std::tan, std::tanh;
