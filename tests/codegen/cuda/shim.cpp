/* Runs a block's fibers in turns, each up to the next __syncthreads, in either order. */
#include <ucontext.h>

#include <cstdlib>
#include <vector>

struct Index { unsigned x, y; };
Index threadIdx, blockIdx;

namespace {
const size_t STACK = 1 << 18;
struct Fiber {
  ucontext_t context;
  Index index;
  bool done;
  std::vector<char> stack;
};
ucontext_t scheduler;
Fiber *running;
void (*kernel)(const void *);
const void *job;

void run() {
  kernel(job);
  running->done = true;
}
}  // namespace

void __syncthreads() { swapcontext(&running->context, &scheduler); }

extern "C" int launch(void (*what)(const void *), unsigned blocks, unsigned x, unsigned y, const void *how, int backwards) {
  kernel = what, job = how;
  std::vector<Fiber> fibers(x * y);
  for (blockIdx.x = 0; blockIdx.x < blocks; blockIdx.x++) {
    for (unsigned i = 0; i < x * y; i++) {
      Fiber &fiber = fibers[i];
      fiber.index = {i % x, i / x}, fiber.done = false, fiber.stack.resize(STACK);
      getcontext(&fiber.context);
      fiber.context.uc_stack.ss_sp = fiber.stack.data(), fiber.context.uc_stack.ss_size = STACK;
      fiber.context.uc_link = &scheduler;
      makecontext(&fiber.context, run, 0);
    }
    for (unsigned left = x * y; left;) {
      unsigned finished = 0;
      for (unsigned k = 0; k < x * y; k++) {
        running = &fibers[backwards ? x * y - 1 - k : k];
        if (running->done) return 1; /* it left the kernel while others still wait */
        threadIdx = running->index;
        swapcontext(&scheduler, &running->context);
        finished += running->done;
      }
      if (finished && finished != x * y) return 1;
      left -= finished;
    }
  }
  return 0;
}
