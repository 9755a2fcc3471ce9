/* The loops over calls and time. A block has LANES robots and WARPS threads for each; a robot's words are LANES apart,
   so that neighbouring threads touch neighbouring words. Programs are data, as in the driver for processors. */
typedef struct {
  const program *p;
  V *memory;
  word rows, first, end; /* robots; steps */
  source z, parameters, seed;
  double *outputs, *gradient, *trajectory;
  word offset, size, stride, count; /* of the trajectory */
  double discount;                      /* of the adjoint of what is discounted, in each step back */
} job;

#define KERNEL(name) extern "C" __global__ void __launch_bounds__(LANES *WARPS) name(const job *x)
#define EACH(i, from, to) for (word i = (from) + threadIdx.y; i < (to); i += WARPS)

static __device__ V *values_of(const job *x) {
  return x->memory + blockIdx.x * (2 * x->p->size + x->p->tape) * LANES + threadIdx.x;
}

static __device__ V *adjoints_of(const job *x) { return values_of(x) + (x->p->size + x->p->tape) * LANES; }

/* Lanes beyond the last row repeat it, so that they compute nothing unusual. */
static __device__ word row_of(const job *x) {
  const word row = (word)blockIdx.x * LANES + threadIdx.x;
  return row < x->rows ? row : x->rows - 1;
}

static __device__ bool inside(const job *x) { return (word)blockIdx.x * LANES + threadIdx.x < x->rows; }

/* Where a word is 0 for all robots of the block, the calls after this entry are without effect. What stands for their
   results is copied, and their adjoints are passed on to that. */
static __device__ bool left_out(const word *t, V *m, V *b, word k) {
  if (__any_sync(0xffffffffu, m[t[3] * LANES] != S(0.0))) return false;
  for (const word *c = t + 4; c < t + t[1]; c += 4)
    for (word w = 0; w < c[3]; w++) {
      const word to = (c[0] + w) * LANES, from = (c[1] + k * c[2] + w) * LANES;
      if (!b) m[to] = m[from];
      else {
        if (c[1] >= 0) b[from] += b[to];
        b[to] = S(0.0);
      }
    }
  return true;
}

static __device__ __noinline__ void run(const phase *calls, V *m, V *b, word k) {
  for (word level = 0; level < calls->levels; level++) {
    const word *span = calls->spans + 2 * (level * WARPS + threadIdx.y);
    const word *t = calls->entries + span[0], *end = calls->entries + span[1];
    while (t < end)
      if (t[0] >= 0) {
        call(t[0], m, b, t + 2, k);
        t += t[1];
      } else t += left_out(t, m, b, k) ? t[2] : t[1];
    __syncthreads();
  }
}

static __device__ void clear(V *m, word first, word count) {
  EACH(w, first, first + count) m[w * LANES] = S(0.0);
}

static __device__ void gather(V *to, const ranges *r, const source *from, word row, bool add) {
  const double *rows = from->rows + from->stride * row;
  for (word i = 0; i < r->count; rows += r->places[2 * i + 1], i++) {
    EACH(j, 0, r->places[2 * i + 1]) {
      V *place = to + (r->places[2 * i] + j) * LANES;
      *place = add ? *place + (V)rows[j] : (V)rows[j];
    }
    __syncthreads(); /* ranges may meet */
  }
}

static __device__ word total(const ranges *r) {
  word sum = 0;
  for (word i = 0; i < r->count; i++) sum += r->places[2 * i + 1];
  return sum;
}

static __device__ void scatter(const job *x, double *to, const V *from, const ranges *r) {
  if (!to || !inside(x)) return;
  double *row = to + row_of(x) * total(r);
  for (word i = 0; i < r->count; row += r->places[2 * i + 1], i++)
    EACH(j, 0, r->places[2 * i + 1]) row[j] = (double)from[(r->places[2 * i] + j) * LANES];
}

KERNEL(begin) {
  const program *p = x->p;
  V *m = values_of(x);
  for (word i = 0; i < p->zeroed.count; i++) clear(m, p->zeroed.places[2 * i], p->zeroed.places[2 * i + 1]);
  __syncthreads();
  const source values = {p->values, 0};
  gather(m, &p->constants, &values, 0, false);
  gather(m, &p->z, &x->z, row_of(x), false);
  gather(m, &p->parameters, &x->parameters, row_of(x), false);
  run(&p->prologue, m, 0, 0);
}

KERNEL(advance) {
  for (word k = x->first; k < x->end; k++) run(&x->p->body, values_of(x), 0, k);
}

/* What the steps from x->first on would write is 0, but the state, which stays. */
KERNEL(rest) {
  const program *p = x->p;
  const word *t = p->written.places, *s = p->discounted;
  V *m = values_of(x);
  for (word i = 0; i < p->written.count; i++, t += 3)
    for (word k = x->first; k < p->steps; k++) clear(m, t[0] + k * t[2], t[1]);
  __syncthreads();
  for (word k = x->first + 1; k <= p->steps; k++)
    EACH(w, s[0], s[0] + s[1]) m[(w + k * s[2]) * LANES] = m[(w + x->first * s[2]) * LANES];
}

KERNEL(finish) {
  V *m = values_of(x);
  run(&x->p->epilogue, m, 0, 0);
  scatter(x, x->outputs, m, &x->p->outputs);
  if (!x->trajectory || !inside(x)) return;
  for (word k = 0; k < x->count; k++)
    EACH(j, 0, x->size)
      x->trajectory[(row_of(x) * x->count + k) * x->size + j] = (double)m[(x->offset + k * x->stride + j) * LANES];
}

KERNEL(seed) {
  V *b = adjoints_of(x);
  clear(b, 0, x->p->size);
  __syncthreads();
  gather(b, &x->p->seeded, &x->seed, row_of(x), true);
  run(&x->p->back_epilogue, values_of(x), b, 0);
}

/* The adjoints of a state that stays from x->first on are those of all its copies. */
KERNEL(rested) {
  const program *p = x->p;
  const word *s = p->discounted;
  V *b = adjoints_of(x);
  for (word k = x->first + 1; k <= p->steps; k++)
    EACH(w, s[0], s[0] + s[1]) b[(w + x->first * s[2]) * LANES] += b[(w + k * s[2]) * LANES];
}

/* The adjoint of what is discounted at step k: a share of it is lost, and all of it where what is kept is 0. */
static __device__ void discount_adjoint(const job *x, const V *m, V *b, word k) {
  const word *s = x->p->discounted, *kept = x->p->kept;
  const V share = (V)(1 - x->discount) * (kept[1] ? m[(kept[0] + k * kept[1]) * LANES] : S(1.0));
  EACH(w, s[0] + k * s[2], s[0] + k * s[2] + s[1]) b[w * LANES] *= share;
  __syncthreads();
}

/* States are in the memory; the scratch of a step is computed again. */
KERNEL(retreat) {
  V *m = values_of(x), *b = adjoints_of(x);
  for (word k = x->end - 1; k >= x->first; k--) {
    run(&x->p->again, m, 0, k);
    run(&x->p->back_body, m, b, k);
    if (x->discount > 0) discount_adjoint(x, m, b, k);
  }
}

KERNEL(collect) {
  V *b = adjoints_of(x);
  run(&x->p->back_prologue, values_of(x), b, 0);
  scatter(x, x->gradient, b, &x->p->z);
}
