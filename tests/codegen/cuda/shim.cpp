/* Runs a block's fibers in turns, each up to the next barrier or vote, in either order. A barrier waits for the whole
   block, a vote for a warp: threads of the same y. */
#include <ucontext.h>

#include <cstdlib>
#include <vector>

struct Index { unsigned x, y; };
Index threadIdx, blockIdx;

namespace {
const size_t STACK = 1 << 18;
enum State { READY, AT_BARRIER, AT_VOTE, DONE };
struct Fiber {
  ucontext_t context;
  Index index;
  State state;
  bool vote; /* its own, then that of its warp */
  std::vector<char> stack;
};
ucontext_t scheduler;
Fiber *running;
void (*kernel)(const void *);
const void *job;

void run() {
  kernel(job);
  running->state = DONE;
}

void wait(State state) {
  running->state = state;
  swapcontext(&running->context, &scheduler);
}

/* Makes ready all of these that wait for the same, once all do; whether it did. */
bool released(Fiber *fibers, unsigned count, State state) {
  bool vote = false;
  for (unsigned i = 0; i < count; i++) {
    if (fibers[i].state != state) return false;
    vote |= fibers[i].vote;
  }
  for (unsigned i = 0; i < count; i++) fibers[i].state = READY, fibers[i].vote = vote;
  return true;
}
}  // namespace

void __syncthreads() { wait(AT_BARRIER); }

int __any_sync(unsigned, int predicate) {
  Fiber *self = running;
  self->vote = predicate;
  wait(AT_VOTE);
  return self->vote;
}

/* 1 where threads wait for different things, or one has left the kernel while others wait. */
extern "C" int launch(void (*what)(const void *), unsigned blocks, unsigned x, unsigned y, const void *how, int backwards) {
  kernel = what, job = how;
  const unsigned count = x * y;
  std::vector<Fiber> fibers(count);
  for (blockIdx.x = 0; blockIdx.x < blocks; blockIdx.x++) {
    for (unsigned i = 0; i < count; i++) {
      Fiber &fiber = fibers[i];
      fiber.index = {i % x, i / x}, fiber.state = READY, fiber.stack.resize(STACK);
      getcontext(&fiber.context);
      fiber.context.uc_stack.ss_sp = fiber.stack.data(), fiber.context.uc_stack.ss_size = STACK;
      fiber.context.uc_link = &scheduler;
      makecontext(&fiber.context, run, 0);
    }
    for (;;) {
      unsigned finished = 0;
      for (unsigned k = 0; k < count; k++) {
        running = &fibers[backwards ? count - 1 - k : k];
        threadIdx = running->index;
        if (running->state == READY) swapcontext(&scheduler, &running->context);
        finished += running->state == DONE;
      }
      if (finished == count) break;
      bool some = released(fibers.data(), count, AT_BARRIER);
      for (unsigned warp = 0; warp < y; warp++) some |= released(&fibers[warp * x], x, AT_VOTE);
      if (!some) return 1;
    }
  }
  return 0;
}
