/* The loops over blocks of lanes, time and calls. Programs are data: what is compiled does not depend on their length. */

typedef struct {
  word rows;
  source z, parameters, seed;
  double *outputs, *gradient, *trajectory;
  word offset, size, stride, count; /* of the trajectory */
  double discount;                      /* of the adjoint of what is discounted, in each step back */
  word skipped;                      /* steps at the end, in which nothing moves */
} batch;

static word total(const ranges *r) {
  word sum = 0;
  for (word i = 0; i < r->count; i++) sum += r->places[2 * i + 1];
  return sum;
}

/* Lanes beyond the last row repeat it, so that they compute nothing unusual. */
static void gather(V *to, const ranges *r, const source *from, word row, word rows, int add) {
  const double *lane[LANES];
  for (word l = 0; l < LANES; l++) lane[l] = from->rows + from->stride * (l < rows ? row + l : row + rows - 1);
  for (word i = 0, j = 0; i < r->count; i++)
    for (word w = r->places[2 * i]; w < r->places[2 * i] + r->places[2 * i + 1]; w++, j++) {
      V x;
      for (word l = 0; l < LANES; l++) LANE(x, l) = (R)lane[l][j];
      to[w] = add ? to[w] + x : x;
    }
}

static void scatter(double *to, const V *from, const ranges *r, word width, word row, word rows) {
  for (word i = 0, j = 0; i < r->count; i++)
    for (word w = r->places[2 * i]; w < r->places[2 * i] + r->places[2 * i + 1]; w++, j++)
      for (word l = 0; l < rows; l++) to[(row + l) * width + j] = (double)LANE(from[w], l);
}

static void fill(const program *p, const batch *x, V *m, word row, word rows) {
  const source values = {p->values, 0};
  for (word i = 0; i < p->zeroed.count; i++)
    memset(m + p->zeroed.places[2 * i], 0, sizeof(V) * p->zeroed.places[2 * i + 1]);
  gather(m, &p->constants, &values, 0, 1, 0);
  gather(m, &p->z, &x->z, row, rows, 0);
  gather(m, &p->parameters, &x->parameters, row, rows, 0);
}

/* What the steps from here on would write is 0, but the state, which stays. */
static void rest(const program *p, word steps, V *m) {
  const word *t = p->written.places, *x = p->discounted;
  for (word i = 0; i < p->written.count; i++, t += 3)
    for (word k = steps; k < p->steps; k++) memset(m + t[0] + k * t[2], 0, sizeof(V) * t[1]);
  for (word k = steps + 1; k <= p->steps; k++)
    memcpy(m + x[0] + k * x[2], m + x[0] + steps * x[2], sizeof(V) * x[1]);
}

static void rested(const program *p, word steps, V *b) {
  const word *x = p->discounted;
  for (word k = steps + 1; k <= p->steps; k++)
    for (word w = 0; w < x[1]; w++) b[x[0] + steps * x[2] + w] += b[x[0] + k * x[2] + w];
}

/* Whether what adjoints read is put on the tape as the values are computed: a program of one step has room for it. */
static int taped_at_once(const program *p) {
  return p->steps == 1 && !p->calls.count && p->again.count == p->body.count;
}

static void roll(const program *p, word steps, V *m, int gradient) {
  run(&p->prologue, m, 0, 0);
  for (word k = 0; k < steps; k++)
    if (p->calls.count) step_left(p, m, k, gradient);
    else run(gradient && taped_at_once(p) ? &p->again : &p->body, m, 0, k);
  if (steps < p->steps) rest(p, steps, m);
  run(&p->epilogue, m, 0, 0);
}

/* The adjoint of what is discounted at step k: a share of it is lost, and all of it where what is kept is 0. */
static void discount_adjoint(const program *p, double discount, const V *m, V *b, word k) {
  const V *kept = m + p->kept[0] + k * p->kept[1];
  V share, *words = b + p->discounted[0] + k * p->discounted[2];
  for (word l = 0; l < LANES; l++) LANE(share, l) = (R)(1 - discount) * (p->kept[1] ? LANE(*kept, l) : (R)1);
  for (word w = 0; w < p->discounted[1]; w++) words[w] = words[w] * share;
}

/* States are in the memory; the scratch of a step, and the tape for its adjoints, are computed again. */
static void pull(const program *p, word steps, double discount, V *m, V *b) {
  run(&p->back_epilogue, m, b, 0);
  if (steps < p->steps) rested(p, steps, b);
  for (word k = steps - 1; k >= 0; k--) {
    if (p->calls.count) back_left(p, m, b, k);
    else {
      if (!taped_at_once(p)) run(&p->again, m, 0, k);
      run(&p->back_body, m, b, k);
    }
    if (discount > 0) discount_adjoint(p, discount, m, b, k);
  }
  run(&p->back_prologue, m, b, 0);
}

static void record(const batch *x, const V *m, word row, word rows) {
  for (word l = 0; l < rows; l++)
    for (word k = 0; k < x->count; k++)
      for (word j = 0; j < x->size; j++)
        x->trajectory[((row + l) * x->count + k) * x->size + j] = (double)LANE(m[x->offset + k * x->stride + j], l);
}

/* Memory: size vectors, then the tape, then size vectors of adjoints, then what ``guards.c`` notes. */
API void evaluate(const program *p, const batch *x, V *m) {
  V *b = m + p->size + p->tape;
#ifdef FRESH
  if (p->calls.count) prepare(p, m);
#endif
  for (word row = 0; row < x->rows; row += LANES) {
    word rows = x->rows - row < LANES ? x->rows - row : LANES;
    fill(p, x, m, row, rows);
    roll(p, p->steps - x->skipped, m, x->gradient != 0);
    if (x->outputs) scatter(x->outputs, m, &p->outputs, total(&p->outputs), row, rows);
    if (x->trajectory) record(x, m, row, rows);
    if (!x->gradient) continue;
    memset(b, 0, sizeof(V) * p->size);
    gather(b, &p->seeded, &x->seed, row, rows, 1);
    pull(p, p->steps - x->skipped, x->discount, m, b);
    scatter(x->gradient, b, &p->z, total(&p->z), row, rows);
  }
}
