/* Graphs of functions: each distinct value once, masks apart from numbers; adjoints, rewriting, C text and codes.
   Python sees a graph as a handle; graph/graph.py says what each function is for. Nodes stand in an order in which they
   can be computed. The process ends where there is no memory left. */
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#pragma GCC visibility push(default) /* what is not static is called from Python */

#define OPERATIONS(X)                                                                                                  \
  X(input) X(const) X(neg) X(exp) X(log) X(sqrt) X(sin) X(cos) X(tan) X(asin) X(acos) X(atan) X(floor) X(ceil) X(erf)  \
  X(sinh) X(cosh) X(tanh) X(asinh) X(acosh) X(atanh) X(log1p) X(expm1) X(fabs) X(add) X(sub) X(mul) X(div) X(pow)      \
  X(fmod) X(remainder) X(copysign) X(atan2) X(hypot) X(lt) X(le) X(eq) X(ne) X(not) X(and) X(or) X(isnt0) X(one)       \
  X(iez) X(select) X(fma) X(fms) X(fnma)
#define FOREIGN(X)                                                                                                     \
  X(sq) X(twice) X(inv) X(assign) X(sign) X(fmin) X(fmax) X(given) X(output) X(constant)
#define NUMBERED(name) op_##name,
enum { OPERATIONS(NUMBERED) FOREIGN(NUMBERED) };
#define NAMED(name) #name " "
/* Names of operations in the order of their numbers, then of what only instructions of casadi have. */
const char *operation_names(void) { return OPERATIONS(NAMED); }
const char *foreign_names(void) { return FOREIGN(NAMED); }

enum { NONE = -1, MAX_STATEMENTS = 500, MIN_RUN = 8, MAX_EXPONENT = 100 };

typedef struct {
  int32_t op, a, b, c; /* operands; of an input its argument and word */
  uint64_t value;      /* bits of a constant */
} node;

typedef struct {
  node *nodes;
  int32_t *slots; /* of the hash table: numbers of nodes */
  int64_t count, room, mask;
  int32_t *sizes, *starts, *results; /* of the arguments; where each result begins among the words of all; these */
  int32_t arguments, outputs;
} graph;

static void *taken(void *old, size_t bytes) {
  void *found = realloc(old, bytes ? bytes : 1);
  if (!found) abort();
  return found;
}

static void *zeros(size_t count, size_t size) {
  void *found = calloc(count ? count : 1, size);
  if (!found) abort();
  return found;
}

static int32_t *filled(int64_t count, int32_t value) {
  int32_t *found = taken(NULL, count * sizeof *found);
  for (int64_t i = 0; i < count; i++) found[i] = value;
  return found;
}

static int leaf(int op) { return op == op_input || op == op_const; }
static int is_mask(int op) { return op >= op_lt && op <= op_isnt0; }
static int commutes(int op) {
  return op == op_add || op == op_mul || op == op_eq || op == op_ne || op == op_and || op == op_or || op == op_hypot;
}
static int operands(const node *x, int32_t y[3]) {
  if (leaf(x->op)) return 0;
  y[0] = x->a, y[1] = x->b, y[2] = x->c;
  return (x->a != NONE) + (x->b != NONE) + (x->c != NONE);
}

/* --- building --- */

static graph *fresh(int32_t arguments, const int32_t *sizes) {
  graph *g = zeros(1, sizeof *g);
  g->arguments = arguments;
  g->sizes = taken(NULL, arguments * sizeof *sizes);
  if (arguments) memcpy(g->sizes, sizes, arguments * sizeof *sizes);
  g->room = 64, g->mask = 127;
  g->nodes = taken(NULL, g->room * sizeof *g->nodes);
  g->slots = filled(g->mask + 1, NONE);
  g->starts = zeros(1, sizeof *g->starts);
  return g;
}

void graph_free(graph *g) {
  if (!g) return;
  free(g->nodes), free(g->slots), free(g->sizes), free(g->starts), free(g->results), free(g);
}

/* Give a graph its results: the words of all, one after the other. */
static void set_results(graph *g, int32_t outputs, const int32_t *starts, int32_t *words) {
  g->outputs = outputs;
  g->starts = taken(g->starts, (outputs + 1) * sizeof *starts);
  memcpy(g->starts, starts, (outputs + 1) * sizeof *starts);
  g->results = words;
}

static uint64_t mixed(uint64_t h) {
  h ^= h >> 33, h *= 0xff51afd7ed558ccdULL, h ^= h >> 33, h *= 0xc4ceb9fe1a85ec53ULL;
  return h ^ h >> 33;
}

static uint64_t hashed(const node *x) {
  return mixed(mixed(((uint64_t)(uint32_t)x->op << 32 | (uint32_t)x->a) * 3 + x->value) ^
               ((uint64_t)(uint32_t)x->b << 32 | (uint32_t)x->c));
}

/* Return the number of a node like this; NONE if there is none. ``slot``: where it would be. */
static int32_t found(const graph *g, const node *x, int64_t *slot) {
  for (*slot = hashed(x) & g->mask; g->slots[*slot] != NONE; *slot = (*slot + 1) & g->mask)
    if (!memcmp(&g->nodes[g->slots[*slot]], x, sizeof *x)) return g->slots[*slot];
  return NONE;
}

static int32_t put(graph *g, node x) {
  int64_t slot;
  const int32_t known = found(g, &x, &slot);
  if (known != NONE) return known;
  if (g->count == g->room) {
    g->room *= 2, g->mask = 2 * g->room - 1;
    g->nodes = taken(g->nodes, g->room * sizeof *g->nodes);
    free(g->slots);
    g->slots = filled(g->mask + 1, NONE);
    for (int64_t i = 0; i < g->count; i++) {
      found(g, &g->nodes[i], &slot);
      g->slots[slot] = i;
    }
    found(g, &x, &slot);
  }
  g->nodes[g->count] = x;
  return g->slots[slot] = g->count++;
}

static node made(int op, int32_t a, int32_t b, int32_t c) {
  if (commutes(op) && a > b) {
    const int32_t other = a;
    a = b, b = other;
  }
  return (node){op, a, b, c, 0};
}

static int32_t constant(graph *g, double value) {
  node x = {op_const, NONE, NONE, NONE, 0};
  if (value != value) value = NAN;
  memcpy(&x.value, &value, sizeof value);
  return put(g, x);
}

static double value_of(const node *x) {
  double value;
  memcpy(&value, &x->value, sizeof value);
  return value;
}

/* The node as a mask: itself, what it was made from, or x != 0. */
static int32_t masked(graph *g, int32_t x) {
  const node n = g->nodes[x];
  return is_mask(n.op) ? x : n.op == op_one ? n.a : put(g, made(op_isnt0, x, NONE, NONE));
}

/* The node as a number: a mask becomes 0 or 1. */
static int32_t number(graph *g, int32_t x) {
  return is_mask(g->nodes[x].op) ? put(g, made(op_one, x, NONE, NONE)) : x;
}

static int32_t add(graph *g, int op, int32_t a, int32_t b, int32_t c);

/* p / (p + q) of truth values, as in derivatives of fmin and fmax, without the division. */
static int32_t share(graph *g, int32_t p, int32_t q) {
  const int32_t on = masked(g, q), half = constant(g, 0.5), one = constant(g, 1.0);
  const int32_t both = add(g, op_select, on, half, one), zero = constant(g, 0.0), not_a_number = constant(g, NAN);
  return add(g, op_select, masked(g, p), both, add(g, op_select, on, zero, not_a_number));
}

static int negates(const graph *g, int32_t x, int32_t y) { return g->nodes[x].op == op_not && g->nodes[x].a == y; }

/* 1 / x of a power of two, whose product is the division to the last bit; 0 for other numbers. */
static double reciprocal(double x) {
  int exponent;
  const double part = frexp(x, &exponent);
  return fabs(part) == 0.5 && abs(exponent) < MAX_EXPONENT ? 1 / x : 0;
}

static int32_t simpler(graph *g, int op, int32_t a, int32_t b) {
  const node x = g->nodes[a], y = b == NONE ? x : g->nodes[b];
  if (op == op_not && x.op == op_not) return x.a;
  if (op == op_add && x.op == op_iez && y.op == op_iez) { /* (c ? x : 0) + (not c ? y : 0) */
    if (negates(g, y.a, x.a)) return add(g, op_select, x.a, x.b, y.b);
    if (negates(g, x.a, y.a)) return add(g, op_select, y.a, y.b, x.b);
  }
  if (op == op_div && y.op == op_const && reciprocal(value_of(&y)))
    return add(g, op_mul, a, constant(g, reciprocal(value_of(&y))), NONE);
  if (op == op_div && x.op == op_one && y.op == op_add && (y.a == a || y.b == a)) {
    const int32_t q = y.a == a ? y.b : y.a;
    if (g->nodes[q].op == op_one) return share(g, a, q);
  }
  return NONE;
}

/* A value, simplified where that is cheap; operands are cast to what the operation takes. */
static int32_t add(graph *g, int op, int32_t a, int32_t b, int32_t c) {
  if (op == op_and || op == op_or || op == op_not) {
    a = masked(g, a), b = b == NONE ? b : masked(g, b);
  } else {
    a = op == op_iez ? masked(g, a) : op == op_select ? a : number(g, a);
    b = b == NONE ? b : number(g, b), c = c == NONE ? c : number(g, c);
  }
  const node x = made(op, a, b, c);
  const int32_t known = simpler(g, op, x.a, x.b);
  return known == NONE ? put(g, x) : known;
}

/* --- what results need --- */

/* Flags of the nodes that results are made from. */
static uint8_t *needed(const graph *g) {
  uint8_t *on = zeros(g->count, 1);
  int32_t y[3];
  for (int32_t i = 0; i < g->starts[g->outputs]; i++) on[g->results[i]] = 1;
  for (int64_t x = g->count - 1; x >= 0; x--)
    if (on[x])
      for (int k = operands(&g->nodes[x], y) - 1; k >= 0; k--) on[y[k]] = 1;
  return on;
}

/* Flags of the nodes that depend on an argument from ``primal`` on. */
static uint8_t *seeded(const graph *g, int32_t primal) {
  uint8_t *on = zeros(g->count, 1);
  int32_t y[3];
  for (int64_t x = 0; x < g->count; x++) {
    const node *n = &g->nodes[x];
    on[x] = n->op == op_input && n->a >= primal;
    for (int k = operands(n, y) - 1; k >= 0; k--) on[x] |= on[y[k]];
  }
  return on;
}

/* Put a node with operands by new numbers into another graph. */
static int32_t moved(graph *into, const node *x, const int32_t *numbers) {
  if (leaf(x->op)) return put(into, *x);
  return put(into, made(x->op, numbers[x->a], x->b == NONE ? NONE : numbers[x->b], x->c == NONE ? NONE : numbers[x->c]));
}

static int32_t *renamed(const graph *g, const int32_t *numbers) {
  const int32_t count = g->starts[g->outputs];
  int32_t *words = taken(NULL, count * sizeof *words);
  for (int32_t i = 0; i < count; i++) words[i] = numbers[g->results[i]];
  return words;
}

/* Return a graph of the needed nodes alone, and free the other. */
static graph *compacted(graph *g) {
  graph *to = fresh(g->arguments, g->sizes);
  uint8_t *on = needed(g);
  int32_t *numbers = filled(g->count, NONE);
  for (int64_t x = 0; x < g->count; x++)
    if (on[x]) numbers[x] = moved(to, &g->nodes[x], numbers);
  set_results(to, g->outputs, g->starts, renamed(g, numbers));
  free(on), free(numbers), graph_free(g);
  return to;
}

/* The same, each value just before what first needs it, as casadi has them: less is kept at once. */
static graph *depth_first(graph *g) {
  graph *to = fresh(g->arguments, g->sizes);
  int32_t *numbers = filled(g->count, NONE), *open = taken(NULL, (3 * g->count + 1) * sizeof *open), y[3];
  for (int32_t i = 0; i < g->starts[g->outputs]; i++) {
    int64_t depth = 0;
    open[depth++] = g->results[i];
    while (depth) {
      const int32_t x = open[depth - 1];
      if (numbers[x] != NONE) {
        depth--;
        continue;
      }
      const int count = operands(&g->nodes[x], y);
      int ready = 1;
      for (int k = count - 1; k >= 0; k--)
        if (numbers[y[k]] == NONE) ready = 0, open[depth++] = y[k];
      if (ready) numbers[x] = moved(to, &g->nodes[x], numbers), depth--;
    }
  }
  set_results(to, g->outputs, g->starts, renamed(g, numbers));
  free(numbers), free(open), graph_free(g);
  return to;
}

/* --- functions of casadi --- */

typedef struct {
  int32_t code;          /* an operation, or one of FOREIGN */
  int32_t a, b;          /* instructions that give the operands; of a given number argument and word */
  int32_t result, word;  /* of an output */
  double value;
} instruction;

typedef struct {
  instruction *list;
  int64_t count;
  int32_t *sizes, *starts, arguments, outputs;
} function;

void function_free(function *f) {
  if (f) free(f->list), free(f->sizes), free(f->starts), free(f);
}

/* Keep the instructions of a function of casadi, whose work vector is renamed: each value has one name.
   code: as above; in, out (count, 2): words of the work vector, or argument and word, or result and word. */
function *function_new(int64_t count, const int32_t *code, const int32_t *in, const int32_t *out, const double *values,
                       int32_t work, int32_t arguments, const int32_t *sizes, int32_t outputs,
                       const int32_t *result_sizes) {
  function *f = zeros(1, sizeof *f);
  int32_t *last = filled(work, NONE);
  f->list = zeros(count, sizeof *f->list), f->count = count;
  f->arguments = arguments, f->outputs = outputs;
  f->sizes = taken(NULL, arguments * sizeof *sizes), f->starts = zeros(outputs + 1, sizeof *f->starts);
  if (arguments) memcpy(f->sizes, sizes, arguments * sizeof *sizes);
  for (int32_t i = 0; i < outputs; i++) f->starts[i + 1] = f->starts[i] + result_sizes[i];
  for (int64_t i = 0; i < count; i++) {
    instruction *x = &f->list[i];
    *x = (instruction){code[i], NONE, NONE, NONE, NONE, values[i]};
    if (x->code == op_given) x->a = in[2 * i], x->b = in[2 * i + 1];
    else if (x->code != op_constant) {
      x->a = last[in[2 * i]];
      if (in[2 * i + 1] != NONE) x->b = last[in[2 * i + 1]];
    }
    if (x->code == op_output) x->result = out[2 * i], x->word = out[2 * i + 1];
    else last[out[2 * i]] = i;
  }
  free(last);
  return f;
}

/* fmin and fmax let a NaN through, unlike those of C and casadi: a NaN must be seen. With a constant that is free. */
static int32_t extreme(graph *g, int smaller, int32_t a, int32_t b) {
  if (g->nodes[b].op == op_const) {
    const int32_t other = a;
    a = b, b = other;
  }
  int32_t before = smaller ? add(g, op_lt, a, b, NONE) : add(g, op_lt, b, a, NONE);
  if (g->nodes[a].op != op_const) before = add(g, op_or, before, add(g, op_ne, a, a, NONE), NONE);
  return add(g, op_select, before, a, b);
}

static int32_t sign_of(graph *g, int32_t x) {
  const int32_t zero = constant(g, 0.0), one = constant(g, 1.0), minus = constant(g, -1.0);
  const int32_t negative = add(g, op_select, add(g, op_lt, x, zero, NONE), minus, x);
  return add(g, op_select, add(g, op_lt, zero, x, NONE), one, negative);
}

/* Put the values of all instructions into a graph; returns their numbers. */
static int32_t *evaluated(graph *g, const function *f) {
  int32_t *at = filled(f->count, NONE);
  for (int64_t i = 0; i < f->count; i++) {
    const instruction *x = &f->list[i];
    const int32_t a = x->a == NONE || x->code == op_given ? NONE : at[x->a];
    const int32_t b = x->b == NONE || x->code == op_given ? NONE : at[x->b];
    switch (x->code) {
      case op_given: at[i] = put(g, (node){op_input, x->a, x->b, NONE, 0}); break;
      case op_constant: at[i] = constant(g, x->value); break;
      case op_output: at[i] = number(g, a); break;
      case op_sq: at[i] = add(g, op_mul, a, a, NONE); break;
      case op_twice: at[i] = add(g, op_add, a, a, NONE); break;
      case op_inv: at[i] = add(g, op_div, constant(g, 1.0), a, NONE); break;
      case op_assign: at[i] = a; break;
      case op_sign: at[i] = sign_of(g, number(g, a)); break;
      case op_fmin: case op_fmax: at[i] = extreme(g, x->code == op_fmin, number(g, a), number(g, b)); break;
      default: at[i] = add(g, x->code, a, b, NONE);
    }
  }
  return at;
}

graph *function_graph(const function *f) {
  graph *g = fresh(f->arguments, f->sizes);
  int32_t *at = evaluated(g, f), *words = filled(f->starts[f->outputs], NONE);
  for (int64_t i = 0; i < f->count; i++)
    if (f->list[i].code == op_output) words[f->starts[f->list[i].result] + f->list[i].word] = at[i];
  set_results(g, f->outputs, f->starts, words);
  free(at);
  return g;
}

/* --- derivatives --- */

static int is(const graph *g, int32_t x, double value) {
  return g->nodes[x].op == op_const && value_of(&g->nodes[x]) == value;
}

static int32_t negative(graph *g, int32_t x) {
  const node n = g->nodes[x];
  if (n.op == op_neg) return n.a;
  if (n.op == op_sub) return add(g, op_sub, n.b, n.a, NONE);
  return n.op == op_const ? constant(g, -value_of(&n)) : add(g, op_neg, x, NONE, NONE);
}

static int32_t times(graph *g, int32_t x, int32_t y);

/* A product x times a number, which is one with a constant that it has. */
static int32_t scaled(graph *g, double by, int32_t x) {
  const node n = g->nodes[x];
  for (int k = 0; k < 2; k++) {
    const node factor = g->nodes[k ? n.b : n.a];
    if (factor.op == op_const) return times(g, constant(g, by * value_of(&factor)), k ? n.a : n.b);
  }
  return add(g, op_mul, constant(g, by), x, NONE);
}

/* Branches that are not taken stay outside: what is not finite in one is dropped, not multiplied by 0. */
static int32_t times(graph *g, int32_t x, int32_t y) {
  const node a = g->nodes[x], b = g->nodes[y];
  if (is(g, x, 0) || is(g, y, 0)) return constant(g, 0);
  if (is(g, x, 1)) return y;
  if (is(g, y, 1)) return x;
  if (is(g, x, -1)) return negative(g, y);
  if (is(g, y, -1)) return negative(g, x);
  if (a.op == op_const && b.op == op_const) return constant(g, value_of(&a) * value_of(&b));
  if (a.op == op_neg) return negative(g, times(g, a.a, y));
  if (b.op == op_neg) return negative(g, times(g, x, b.a));
  if (a.op == op_iez) return add(g, op_iez, a.a, times(g, a.b, y), NONE);
  if (b.op == op_iez) return add(g, op_iez, b.a, times(g, x, b.b), NONE);
  if (b.op == op_const && a.op == op_mul) return scaled(g, value_of(&b), x);
  if (a.op == op_const && b.op == op_mul) return scaled(g, value_of(&a), y);
  return add(g, op_mul, x, y, NONE);
}

static int32_t over(graph *g, int32_t x, int32_t y) {
  const node a = g->nodes[x];
  if (a.op == op_neg) return negative(g, over(g, a.a, y));
  if (a.op == op_iez) return add(g, op_iez, a.a, over(g, a.b, y), NONE);
  return add(g, op_div, x, y, NONE);
}

static int32_t plus(graph *g, int32_t x, int32_t y) {
  if (x == NONE || is(g, x, 0)) return y;
  if (is(g, y, 0)) return x;
  if (g->nodes[x].op == op_neg && g->nodes[y].op == op_neg)
    return negative(g, plus(g, g->nodes[x].a, g->nodes[y].a));
  if (g->nodes[y].op == op_neg) return x == g->nodes[y].a ? constant(g, 0) : add(g, op_sub, x, g->nodes[y].a, NONE);
  if (g->nodes[x].op == op_neg) return y == g->nodes[x].a ? constant(g, 0) : add(g, op_sub, y, g->nodes[x].a, NONE);
  return add(g, op_add, x, y, NONE);
}

static int32_t squared(graph *g, int32_t x) { return add(g, op_mul, x, x, NONE); }
static int32_t binary(graph *g, int op, int32_t x, int32_t y) { return add(g, op, x, y, NONE); }
static int32_t unary(graph *g, int op, int32_t x) { return add(g, op, x, NONE, NONE); }
static int32_t twice(graph *g, int32_t x) {
  const int32_t less = times(g, constant(g, 2), x);
  const node n = g->nodes[less];
  return n.op == op_mul && (n.a == x || n.b == x) ? add(g, op_add, x, x, NONE) : less;
}

static int32_t root(graph *g, int32_t x) { return add(g, op_sqrt, x, NONE, NONE); }

/* The slope of a value by an operand: ``by`` divided by ``over``, where that is no NONE. */
typedef struct {
  int32_t by, over;
} slope;

/* The slopes of an instruction's value f by its operands x and y, as casadi has them; 0: none. A branch that is not
   taken has none: ``branch`` is its mask then. */
static void slopes(graph *g, const instruction *i, int32_t x, int32_t y, int32_t f, slope d[2], int32_t *branch) {
  const int32_t one = constant(g, 1), zero = constant(g, 0);
  d[0] = d[1] = (slope){zero, NONE}, *branch = NONE;
  switch (i->code) {
    case op_add: d[0].by = d[1].by = one; break;
    case op_sub: d[0].by = one, d[1].by = constant(g, -1); break;
    case op_mul: d[0].by = number(g, y), d[1].by = number(g, x); break;
    case op_div: d[0] = (slope){one, y}, d[1].by = negative(g, binary(g, op_div, f, y)); break;
    case op_neg: d[0].by = constant(g, -1); break;
    case op_assign: d[0].by = one; break;
    case op_sq: case op_twice: d[0].by = i->code == op_sq ? twice(g, x) : constant(g, 2); break;
    case op_inv: d[0].by = negative(g, squared(g, f)); break;
    case op_exp: d[0].by = f; break;
    case op_log: d[0] = (slope){one, x}; break;
    case op_sqrt: d[0] = (slope){one, twice(g, f)}; break;
    case op_sin: d[0].by = unary(g, op_cos, x); break;
    case op_cos: d[0].by = negative(g, unary(g, op_sin, x)); break;
    case op_tan: d[0].by = plus(g, one, squared(g, f)); break;
    case op_asin: case op_acos:
      d[0] = (slope){i->code == op_asin ? one : constant(g, -1), root(g, binary(g, op_sub, one, squared(g, x)))};
      break;
    case op_atan: d[0] = (slope){one, plus(g, one, squared(g, x))}; break;
    case op_erf:
      d[0].by = times(g, constant(g, 2 / sqrt(M_PI)), unary(g, op_exp, negative(g, squared(g, x))));
      break;
    case op_sinh: d[0].by = unary(g, op_cosh, x); break;
    case op_cosh: d[0].by = unary(g, op_sinh, x); break;
    case op_tanh: d[0].by = binary(g, op_sub, one, squared(g, f)); break;
    case op_asinh: d[0] = (slope){one, root(g, plus(g, one, squared(g, x)))}; break;
    case op_acosh: d[0] = (slope){one, root(g, binary(g, op_sub, squared(g, x), one))}; break;
    case op_atanh: d[0] = (slope){one, binary(g, op_sub, one, squared(g, x))}; break;
    case op_log1p: d[0] = (slope){one, plus(g, one, x)}; break;
    case op_expm1: d[0].by = plus(g, f, one); break;
    case op_fabs: d[0].by = sign_of(g, number(g, x)); break;
    case op_pow:
      d[0].by = times(g, y, binary(g, op_pow, x, binary(g, op_sub, y, one)));
      if (g->nodes[y].op != op_const) d[1].by = times(g, f, unary(g, op_log, x));
      break;
    case op_fmod: case op_remainder: d[0].by = one, d[1] = (slope){binary(g, op_sub, f, x), y}; break;
    case op_copysign: d[0].by = times(g, sign_of(g, number(g, x)), binary(g, op_copysign, one, y)); break;
    case op_atan2: {
      const int32_t over = plus(g, squared(g, x), squared(g, y));
      d[0].by = binary(g, op_div, y, over), d[1].by = negative(g, binary(g, op_div, x, over));
      break;
    }
    case op_hypot: d[0].by = binary(g, op_div, x, f), d[1].by = binary(g, op_div, y, f); break;
    case op_fmin: case op_fmax: { /* half each where both are equal */
      const int32_t p = binary(g, op_le, i->code == op_fmin ? x : y, i->code == op_fmin ? y : x);
      const int32_t q = binary(g, op_le, i->code == op_fmin ? y : x, i->code == op_fmin ? x : y);
      d[0].by = share(g, p, q), d[1].by = share(g, q, p);
      break;
    }
    case op_iez: d[1].by = one, *branch = masked(g, x); break;
    default: break; /* comparisons, logic, floor, ceil, sign: flat */
  }
}

static int32_t through(graph *g, slope d, int32_t branch, int32_t by) {
  int32_t product = times(g, d.by, by);
  if (is(g, product, 0)) return product;
  if (d.over != NONE) product = over(g, product, d.over);
  return branch == NONE ? product : add(g, op_iez, branch, product, NONE);
}

/* Replace several divisions by one value by products with its reciprocal; those of the first ``own`` nodes, which the
   call itself computes, stay as they are, so that they need not be computed twice. Frees the other graph. */
static graph *with_reciprocals(graph *g, int64_t own) {
  graph *to = fresh(g->arguments, g->sizes);
  uint8_t *on = needed(g);
  int32_t *numbers = filled(g->count, NONE), *divisions = zeros(g->count, sizeof *divisions);
  for (int64_t x = own; x < g->count; x++)
    if (on[x] && g->nodes[x].op == op_div) divisions[g->nodes[x].b]++;
  for (int64_t x = 0; x < g->count; x++) {
    const node *n = &g->nodes[x];
    if (!on[x]) continue;
    if (x < own || n->op != op_div || divisions[n->b] < 2) numbers[x] = moved(to, n, numbers);
    else {
      const int32_t over = add(to, op_div, constant(to, 1), numbers[n->b], NONE);
      numbers[x] = add(to, op_mul, numbers[n->a], over, NONE);
    }
  }
  set_results(to, g->outputs, g->starts, renamed(g, numbers));
  free(on), free(numbers), free(divisions), graph_free(g);
  return to;
}

/* What adjoints of a function share: its graph with all slopes, and what depends on the wanted arguments. */
typedef struct {
  const function *f;
  graph *g;
  int64_t own; /* nodes of the function itself */
  int32_t *at, *branch;
  slope (*d)[2];
  uint8_t *moves;
} differentiated;

static differentiated differentiate(const function *f, const uint8_t *wanted, int32_t seeds, const int32_t *sizes) {
  differentiated t = {.f = f};
  int32_t *all = taken(NULL, (f->arguments + seeds) * sizeof *all);
  if (f->arguments) memcpy(all, f->sizes, f->arguments * sizeof *all);
  if (seeds) memcpy(all + f->arguments, sizes, seeds * sizeof *all);
  t.g = fresh(f->arguments + seeds, all);
  free(all);
  t.at = evaluated(t.g, f), t.own = t.g->count;
  t.d = zeros(f->count, sizeof *t.d), t.branch = filled(f->count, NONE), t.moves = zeros(f->count, 1);
  for (int64_t i = 0; i < f->count; i++) {
    const instruction *x = &f->list[i];
    if (x->code == op_given) t.moves[i] = wanted[x->a];
    else if (x->code != op_constant) t.moves[i] = t.moves[x->a] || (x->b != NONE && t.moves[x->b]);
    if (!t.moves[i] || x->code == op_given) continue;
    if (x->code == op_output) t.d[i][0] = (slope){constant(t.g, 1), NONE};
    else slopes(t.g, x, t.at[x->a], x->b == NONE ? NONE : t.at[x->b], t.at[i], t.d[i], &t.branch[i]);
  }
  return t;
}

static graph *finished(differentiated *t) {
  free(t->at), free(t->d), free(t->branch), free(t->moves);
  return depth_first(with_reciprocals(t->g, t->own));
}

/* Spread adjoints (instructions,) back from the outputs: what they add to each word of the arguments, in ``to``. */
static void spread_back(differentiated *t, int32_t *bar, const int32_t *first, int32_t *to) {
  graph *g = t->g;
  for (int64_t i = t->f->count - 1; i >= 0; i--) {
    const instruction *x = &t->f->list[i];
    if (bar[i] == NONE || !t->moves[i]) continue;
    if (x->code == op_given) {
      to[first[x->a] + x->b] = plus(g, to[first[x->a] + x->b], bar[i]);
      continue;
    }
    const int32_t each[2] = {x->a, x->b};
    for (int k = 0; k < 2; k++) {
      if (each[k] == NONE || !t->moves[each[k]]) continue;
      const int32_t more = through(g, t->d[i][k], t->branch[i], bar[i]);
      if (!is(g, more, 0)) bar[each[k]] = plus(g, bar[each[k]], more);
    }
  }
}

static int32_t *begins(const function *f) {
  int32_t *first = zeros(f->arguments + 1, sizeof *first);
  for (int32_t i = 0; i < f->arguments; i++) first[i + 1] = first[i] + f->sizes[i];
  return first;
}

/* Make the words of the wanted arguments the results of a graph. */
static void give(graph *g, const function *f, const uint8_t *wanted, const int32_t *first, const int32_t *to) {
  int32_t *starts = zeros(f->arguments + 1, sizeof *starts), count = 0;
  int32_t *words = taken(NULL, (first[f->arguments] + 1) * sizeof *words);
  for (int32_t i = 0; i < f->arguments; i++) {
    if (!wanted[i]) continue;
    starts[count + 1] = starts[count] + f->sizes[i];
    for (int32_t w = 0; w < f->sizes[i]; w++) {
      const int32_t x = to[first[i] + w];
      words[starts[count] + w] = x == NONE ? constant(g, 0) : x;
    }
    count++;
  }
  set_results(g, count, starts, words);
  free(starts);
}

/* The seeds of the marked outputs: for each output the argument that its adjoint is. */
static int32_t *seed_arguments(const function *f, const uint8_t *marked, int32_t *count, int32_t **sizes) {
  int32_t *argument = filled(f->outputs, NONE);
  *sizes = taken(NULL, f->outputs * sizeof **sizes), *count = 0;
  for (int32_t r = 0; r < f->outputs; r++)
    if (marked[r]) argument[r] = f->arguments + *count, (*sizes)[(*count)++] = f->starts[r + 1] - f->starts[r];
  return argument;
}

static graph *with_early_sums(graph *g, int32_t primal);

/* A graph of the arguments, then the adjoints of the marked results; a result for each wanted argument. */
graph *function_adjoint(const function *f, const uint8_t *wanted, const uint8_t *marked) {
  int32_t seeds, *sizes, *argument = seed_arguments(f, marked, &seeds, &sizes);
  differentiated t = differentiate(f, wanted, seeds, sizes);
  int32_t *bar = filled(f->count, NONE), *first = begins(f), *to = filled(first[f->arguments], NONE);
  for (int64_t i = 0; i < f->count; i++)
    if (f->list[i].code == op_output && marked[f->list[i].result])
      bar[i] = put(t.g, (node){op_input, argument[f->list[i].result], f->list[i].word, NONE, 0});
  spread_back(&t, bar, first, to);
  give(t.g, f, wanted, first, to);
  free(bar), free(first), free(to), free(sizes), free(argument);
  return with_early_sums(finished(&t), f->arguments);
}

/* The same by all slopes, which are multiplied with the adjoints: more to compute, but of it only the products depend
   on the adjoints. Slopes go row by row backwards, or column by column forwards where there are fewer of these. */
graph *function_tabled(const function *f, const uint8_t *wanted, const uint8_t *marked) {
  int32_t seeds, *sizes, *argument = seed_arguments(f, marked, &seeds, &sizes);
  differentiated t = differentiate(f, wanted, seeds, sizes);
  graph *g = t.g;
  int32_t *first = begins(f), *to = filled(first[f->arguments], NONE), rows = 0, columns = 0;
  for (int32_t r = 0; r < f->outputs; r++) rows += marked[r] * (f->starts[r + 1] - f->starts[r]);
  for (int32_t i = 0; i < f->arguments; i++) columns += wanted[i] * f->sizes[i];
  int32_t *own = taken(NULL, (first[f->arguments] + 1) * sizeof *own), *bar = taken(NULL, f->count * sizeof *bar);
  if (rows <= columns) {
    int64_t *outputs = taken(NULL, (f->starts[f->outputs] + 1) * sizeof *outputs);
    for (int32_t i = 0; i < f->starts[f->outputs]; i++) outputs[i] = NONE;
    for (int64_t i = 0; i < f->count; i++)
      if (f->list[i].code == op_output) outputs[f->starts[f->list[i].result] + f->list[i].word] = i;
    for (int32_t r = 0; r < f->outputs; r++)
      for (int32_t w = 0; marked[r] && w < f->starts[r + 1] - f->starts[r]; w++) {
        const int64_t output = outputs[f->starts[r] + w];
        if (output == NONE || !t.moves[output]) continue;
        for (int64_t i = 0; i < f->count; i++) bar[i] = NONE;
        for (int32_t i = 0; i < first[f->arguments]; i++) own[i] = NONE;
        bar[output] = constant(g, 1);
        spread_back(&t, bar, first, own);
        const int32_t seed = put(g, (node){op_input, argument[r], w, NONE, 0});
        for (int32_t i = 0; i < first[f->arguments]; i++)
          if (own[i] != NONE) to[i] = plus(g, to[i], times(g, own[i], seed));
      }
    free(outputs);
  } else {
    for (int32_t a = 0; a < f->arguments; a++)
      for (int32_t w = 0; wanted[a] && w < f->sizes[a]; w++) {
        for (int64_t i = 0; i < f->count; i++) {
          const instruction *x = &f->list[i];
          bar[i] = x->code == op_given && x->a == a && x->b == w ? constant(g, 1) : NONE;
          if (x->code == op_given || !t.moves[i]) continue;
          const int32_t each[2] = {x->a, x->b};
          for (int k = 0; k < 2; k++)
            if (each[k] != NONE && bar[each[k]] != NONE) {
              const int32_t more = through(g, t.d[i][k], t.branch[i], bar[each[k]]);
              if (!is(g, more, 0)) bar[i] = plus(g, bar[i], more);
            }
          if (x->code == op_output && marked[x->result] && bar[i] != NONE) {
            const int32_t seed = put(g, (node){op_input, argument[x->result], x->word, NONE, 0});
            int32_t *sum = &to[first[a] + w];
            *sum = plus(g, *sum, times(g, bar[i], seed));
          }
        }
      }
  }
  give(g, f, wanted, first, to);
  free(own), free(bar), free(first), free(to), free(sizes), free(argument);
  return finished(&t);
}

/* --- sums of adjoints ---
   An adjoint adds up what each use of a value gives it, one after the other. In a sweep each sum needs the one before
   it, so that a processor waits for ten additions a row. Here terms are added as they come, in two sums that are added
   last. */

enum { LATENCY = 4, DIVISION = 13, ROOT = 20, MIN_GAIN = 2 * LATENCY }; /* cycles until a result is there, about */

typedef struct {
  int32_t sign, x;
} term;

/* The latency of a sum whose terms, of which every ``step``th counts, are added one after the other [cycles]. */
static int64_t chained(const int64_t *at, int64_t count, int64_t step) {
  int64_t time = at[0];
  for (int64_t i = step; i < count; i += step) time = (time > at[i] ? time : at[i]) + LATENCY;
  return time;
}

static term added(graph *g, const term *terms, int64_t count, int64_t step) {
  term sum = terms[0];
  for (int64_t i = step; i < count; i += step) {
    const term other = terms[i];
    if (sum.sign == other.sign) sum.x = put(g, made(op_add, sum.x, other.x, NONE));
    else {
      sum.x = sum.sign > 0 ? put(g, made(op_sub, sum.x, other.x, NONE)) : put(g, made(op_sub, other.x, sum.x, NONE));
      sum.sign = 1;
    }
  }
  return sum;
}

typedef struct {
  int64_t at, order;
  term term;
} timed;

static int by_time(const void *x, const void *y) {
  const timed *a = x, *b = y;
  return a->at != b->at ? (a->at > b->at) - (a->at < b->at) : (a->order > b->order) - (a->order < b->order);
}

/* A node for a sum: as it was, or two sums of the early terms first, then the late ones. */
static int32_t summed(graph *g, const term *terms, int64_t count, const int64_t *ready) {
  timed *early = taken(NULL, count * sizeof *early);
  int64_t *at = taken(NULL, 2 * count * sizeof *at), *late = at + count, chosen = 0;
  for (int64_t i = 0; i < count; i++) {
    late[i] = ready[terms[i].x];
    early[i] = (timed){ready[terms[i].x], i, terms[i]};
  }
  int64_t best = chained(late, count, 1) - MIN_GAIN;
  qsort(early, count, sizeof *early, by_time);
  for (int64_t i = 0; i < count; i++) at[i] = early[i].at;
  for (int64_t n = count; n > 3; n--) {
    const int64_t one = chained(at, n, 2), two = chained(at + 1, n - 1, 2);
    late[0] = (one > two ? one : two) + LATENCY;
    if (count > n) memcpy(late + 1, at + n, (count - n) * sizeof *at);
    const int64_t time = chained(late, count - n + 1, 1);
    if (time < best) best = time, chosen = n;
  }
  term sum;
  if (!chosen) sum = added(g, terms, count, 1);
  else {
    term *list = taken(NULL, (count + 2) * sizeof *list);
    for (int64_t i = 0; i < count; i++) list[i + 2] = early[i].term;
    const term one = added(g, list + 2, chosen, 2), two = added(g, list + 3, chosen - 1, 2);
    list[chosen] = one, list[chosen + 1] = two; /* in place of the last early terms */
    sum = added(g, list + chosen, count - chosen + 2, 1);
    free(list);
  }
  free(early), free(at);
  return sum.sign > 0 ? sum.x : put(g, made(op_neg, sum.x, NONE, NONE));
}

/* Return an adjoint with its sums in that order, and free the other; sums of arguments alone stay as they are. */
static graph *with_early_sums(graph *g, int32_t primal) {
  uint8_t *on = needed(g), *late = seeded(g, primal), *sums = zeros(g->count, 1), *within = zeros(g->count, 1);
  int32_t *uses = zeros(g->count, sizeof *uses), *numbers = filled(g->count, NONE), y[3];
  graph *to = fresh(g->arguments, g->sizes);
  for (int64_t x = 0; x < g->count; x++) {
    if (!on[x]) continue;
    sums[x] = (g->nodes[x].op == op_add || g->nodes[x].op == op_sub) && late[x];
    for (int k = operands(&g->nodes[x], y) - 1; k >= 0; k--) uses[y[k]]++;
  }
  for (int32_t i = 0; i < g->starts[g->outputs]; i++) uses[g->results[i]]++;
  for (int64_t x = 0; x < g->count; x++)
    if (sums[x])
      for (int k = operands(&g->nodes[x], y) - 1; k >= 0; k--) within[y[k]] = sums[y[k]] && uses[y[k]] == 1;
  int64_t room = 64, ready_room = 0, timed_nodes = 0, *ready = NULL;
  term *terms = taken(NULL, room * sizeof *terms), *open = taken(NULL, (g->count + 2) * sizeof *open);
  for (int64_t x = 0; x < g->count; x++) {
    if (!on[x] || within[x]) continue;
    if (!sums[x]) {
      numbers[x] = moved(to, &g->nodes[x], numbers);
      continue;
    }
    int64_t depth = 0, count = 0;
    open[depth++] = (term){1, x};
    while (depth) {
      const term next = open[--depth];
      if (next.x != x && !within[next.x]) {
        if (count == room) terms = taken(terms, (room *= 2) * sizeof *terms);
        terms[count++] = (term){next.sign, numbers[next.x]};
        continue;
      }
      const node *n = &g->nodes[next.x];
      open[depth++] = (term){n->op == op_sub ? -next.sign : next.sign, n->b};
      open[depth++] = (term){next.sign, n->a};
    }
    if (to->count > ready_room) ready = taken(ready, (ready_room = 2 * to->count) * sizeof *ready);
    for (; timed_nodes < to->count; timed_nodes++) {
      const node *n = &to->nodes[timed_nodes];
      int64_t time = 0;
      for (int k = operands(n, y) - 1; k >= 0; k--) time = ready[y[k]] > time ? ready[y[k]] : time;
      ready[timed_nodes] = time + (leaf(n->op) ? 0 : n->op == op_div ? DIVISION : n->op == op_sqrt ? ROOT : LATENCY);
    }
    numbers[x] = summed(to, terms, count, ready);
  }
  set_results(to, g->outputs, g->starts, renamed(g, numbers));
  free(on), free(late), free(sums), free(within), free(uses), free(numbers), free(terms), free(open), free(ready);
  graph_free(g);
  return compacted(to);
}

static graph *copied(const graph *g) {
  graph *to = taken(NULL, sizeof *to);
  *to = *g;
  to->nodes = taken(NULL, g->room * sizeof *g->nodes);
  memcpy(to->nodes, g->nodes, g->count * sizeof *g->nodes);
  to->slots = taken(NULL, (g->mask + 1) * sizeof *g->slots);
  memcpy(to->slots, g->slots, (g->mask + 1) * sizeof *g->slots);
  to->sizes = taken(NULL, g->arguments * sizeof *g->sizes);
  if (g->arguments) memcpy(to->sizes, g->sizes, g->arguments * sizeof *g->sizes);
  to->starts = NULL, to->results = NULL;
  int32_t *words = taken(NULL, g->starts[g->outputs] * sizeof *words);
  if (g->starts[g->outputs]) memcpy(words, g->results, g->starts[g->outputs] * sizeof *words);
  set_results(to, g->outputs, g->starts, words);
  return to;
}

/* Early sums of a graph, for tests. */
graph *graph_early_sums(const graph *g, int32_t primal) { return with_early_sums(copied(g), primal); }

/* --- a tape between a call and its adjoint --- */

/* Put all that depends on a call's arguments only on a tape: a load costs less than any operation, even where the tape
   of a step is larger than the second cache. Masks are computed again. Returns the words of the tape; 0: none is worth
   it. ``push``: the call, with the tape as its last result; ``pull``: the adjoint, with the tape as an argument between
   those of the call and the adjoints of its results. */
int32_t graph_taped(const graph *forward, const graph *adjoint, graph **push, graph **pull) {
  const int32_t primal = forward->arguments;
  uint8_t *on = needed(adjoint), *late = seeded(adjoint, primal), *kept = zeros(adjoint->count, 1);
  uint8_t *seen = zeros(adjoint->count, 1), *leaves = zeros(adjoint->count, 1);
  int32_t *slot = filled(adjoint->count, NONE), *open = taken(NULL, (3 * adjoint->count + 3) * sizeof *open), y[3];
  int32_t size = 0, words = adjoint->starts[adjoint->outputs];
  for (int64_t x = 0; x < adjoint->count; x++) {
    const int op = adjoint->nodes[x].op;
    kept[x] = on[x] && !late[x] && !leaf(op) && !is_mask(op);
  }
  for (int32_t i = 0; i < words; i++) { /* what results reach without passing another kept value */
    int64_t depth = 0;
    open[depth++] = adjoint->results[i];
    while (depth) {
      const int32_t x = open[--depth];
      if (seen[x]) continue;
      seen[x] = 1;
      if (kept[x]) leaves[x] = 1;
      else
        for (int k = operands(&adjoint->nodes[x], y) - 1; k >= 0; k--) open[depth++] = y[k];
    }
  }
  for (int64_t x = 0; x < adjoint->count; x++)
    if (leaves[x]) slot[x] = size++;
  if (size) {
    /* the adjoint reads the tape */
    int32_t *sizes = taken(NULL, (adjoint->arguments + 1) * sizeof *sizes), *numbers = filled(adjoint->count, NONE);
    memcpy(sizes, adjoint->sizes, primal * sizeof *sizes);
    sizes[primal] = size;
    memcpy(sizes + primal + 1, adjoint->sizes + primal, (adjoint->arguments - primal) * sizeof *sizes);
    *pull = fresh(adjoint->arguments + 1, sizes);
    uint8_t *mine = zeros(adjoint->count, 1);
    for (int32_t i = 0; i < words; i++) mine[adjoint->results[i]] = 1;
    for (int64_t x = adjoint->count - 1; x >= 0; x--)
      if (mine[x] && !leaves[x])
        for (int k = operands(&adjoint->nodes[x], y) - 1; k >= 0; k--) mine[y[k]] = 1;
    for (int64_t x = 0; x < adjoint->count; x++) {
      node n = adjoint->nodes[x];
      if (!mine[x]) continue;
      if (leaves[x]) numbers[x] = put(*pull, (node){op_input, primal, slot[x], NONE, 0});
      else {
        if (n.op == op_input && n.a >= primal) n.a++;
        numbers[x] = moved(*pull, &n, numbers);
      }
    }
    set_results(*pull, adjoint->outputs, adjoint->starts, renamed(adjoint, numbers));
    /* the call writes it */
    *push = copied(forward);
    memset(mine, 0, adjoint->count);
    for (int64_t x = adjoint->count - 1; x >= 0; x--) {
      mine[x] |= leaves[x];
      if (mine[x])
        for (int k = operands(&adjoint->nodes[x], y) - 1; k >= 0; k--) mine[y[k]] = 1;
    }
    for (int64_t x = 0; x < adjoint->count; x++)
      if (mine[x]) numbers[x] = moved(*push, &adjoint->nodes[x], numbers);
    const int32_t before = forward->starts[forward->outputs];
    int32_t *starts = taken(NULL, (forward->outputs + 2) * sizeof *starts);
    int32_t *results = taken(NULL, (before + size) * sizeof *results);
    memcpy(starts, forward->starts, (forward->outputs + 1) * sizeof *starts);
    starts[forward->outputs + 1] = before + size;
    if (before) memcpy(results, forward->results, before * sizeof *results);
    for (int64_t x = 0; x < adjoint->count; x++)
      if (leaves[x]) results[before + slot[x]] = numbers[x];
    free((*push)->results);
    set_results(*push, forward->outputs + 1, starts, results);
    free(sizes), free(numbers), free(mine), free(starts);
  }
  free(on), free(late), free(kept), free(seen), free(leaves), free(slot), free(open);
  return size;
}

/* --- questions --- */

int64_t graph_count(const graph *g) { return g->count; }
int32_t graph_arguments(const graph *g) { return g->arguments; }
int32_t graph_outputs(const graph *g) { return g->outputs; }

/* Write the sizes of the arguments, then of the results. */
void graph_sizes(const graph *g, int32_t *sizes) {
  for (int32_t i = 0; i < g->arguments; i++) sizes[i] = g->sizes[i];
  for (int32_t i = 0; i < g->outputs; i++) sizes[g->arguments + i] = g->starts[i + 1] - g->starts[i];
}

/* Write all nodes (count, 4) with the bits of their constants, and the words of all results. */
void graph_nodes(const graph *g, int32_t *nodes, double *values, int32_t *results) {
  for (int64_t x = 0; x < g->count; x++) {
    memcpy(nodes + 4 * x, &g->nodes[x].op, 4 * sizeof *nodes);
    values[x] = value_of(&g->nodes[x]);
  }
  for (int32_t i = 0; i < g->starts[g->outputs]; i++) results[i] = g->results[i];
}

void graph_needed(const graph *g, uint8_t *flags) {
  uint8_t *on = needed(g);
  memcpy(flags, on, g->count);
  free(on);
}

/* Operations that results need. */
int64_t graph_operations(const graph *g) {
  uint8_t *on = needed(g);
  int64_t count = 0;
  for (int64_t x = 0; x < g->count; x++) count += on[x] && !leaf(g->nodes[x].op);
  free(on);
  return count;
}

/* Flag the arguments that results read. */
void graph_reads(const graph *g, uint8_t *flags) {
  uint8_t *on = needed(g);
  memset(flags, 0, g->arguments);
  for (int64_t x = 0; x < g->count; x++)
    if (on[x] && g->nodes[x].op == op_input) flags[g->nodes[x].a] = 1;
  free(on);
}

/* Write two hashes of what is equal for equal functions. */
void graph_key(const graph *g, uint64_t key[2]) {
  uint64_t a = 0x9e3779b97f4a7c15ULL, b = g->count;
  for (int32_t i = 0; i < g->arguments; i++) a = mixed(a ^ g->sizes[i]), b = mixed(b * 5 + g->sizes[i]);
  for (int64_t x = 0; x < g->count; x++) a = mixed(a ^ hashed(&g->nodes[x])), b = mixed(b * 3 + hashed(&g->nodes[x]));
  for (int32_t i = 0; i <= g->outputs; i++) a = mixed(a ^ g->starts[i]), b = mixed(b * 7 + g->starts[i]);
  for (int32_t i = 0; i < g->starts[g->outputs]; i++) a = mixed(a ^ g->results[i]), b = mixed(b * 9 + g->results[i]);
  key[0] = a, key[1] = b;
}

/* Flag for each word of the results (rows,) on which arguments, or on which of their words, it depends. */
void graph_dependence(const graph *g, int32_t by_word, uint8_t *flags) {
  int32_t *first = zeros(g->arguments + 1, sizeof *first), y[3];
  for (int32_t i = 0; i < g->arguments; i++) first[i + 1] = first[i] + (by_word ? g->sizes[i] : 1);
  const int64_t columns = first[g->arguments], wide = columns / 64 + 1;
  uint64_t *bits = zeros(g->count * wide, sizeof *bits);
  for (int64_t x = 0; x < g->count; x++) {
    const node *n = &g->nodes[x];
    if (n->op == op_input) {
      const int64_t at = first[n->a] + (by_word ? n->b : 0);
      bits[x * wide + at / 64] |= 1ULL << at % 64;
    }
    for (int k = operands(n, y) - 1; k >= 0; k--)
      for (int64_t i = 0; i < wide; i++) bits[x * wide + i] |= bits[y[k] * wide + i];
  }
  for (int32_t row = 0; row < g->starts[g->outputs]; row++)
    for (int64_t i = 0; i < columns; i++)
      flags[row * columns + i] = bits[g->results[row] * wide + i / 64] >> i % 64 & 1;
  free(first), free(bits);
}

/* --- fused products --- */

/* Fuse products that are only added or subtracted with their sums into one rounding. Nodes keep their numbers. ``adds``:
   results are added to what is there, so that products among them are fused there. */
graph *graph_fused(const graph *old, int32_t adds) {
  graph *g = copied(old);
  uint8_t *on = needed(g), *products = zeros(g->count, 1);
  int32_t y[3];
  for (int64_t x = 0; x < g->count; x++) products[x] = on[x] && g->nodes[x].op == op_mul;
  for (int64_t x = 0; x < g->count; x++)
    if (on[x] && g->nodes[x].op != op_add && g->nodes[x].op != op_sub)
      for (int k = operands(&g->nodes[x], y) - 1; k >= 0; k--) products[y[k]] = 0;
  if (!adds)
    for (int32_t i = 0; i < g->starts[g->outputs]; i++) products[g->results[i]] = 0;
  for (int64_t x = 0; x < g->count; x++) {
    node *n = &g->nodes[x];
    if (!on[x] || (n->op != op_add && n->op != op_sub)) continue;
    const int both = n->op == op_add, first = products[n->a];
    if (!first && !products[n->b]) continue;
    const node product = g->nodes[first ? n->a : n->b];
    *n = (node){both ? op_fma : first ? op_fms : op_fnma, product.a, product.b, first ? n->b : n->a, 0};
  }
  free(on), free(products);
  return g;
}

/* --- pieces: nodes in order, cut where a compiler's register allocation would take too long --- */

typedef struct {
  int32_t piece, x, result, first, count;
} target; /* words of a result that a value is */

typedef struct {
  graph *g;                 /* with fused products where it may have some; its own copy */
  int32_t *order, computed; /* what is computed, in order: MAX_STATEMENTS of them are a piece */
  int32_t *home, *slot;     /* of each node its piece, NONE: it is given; its word in the buffer between pieces */
  uint8_t *fused;           /* products that only results have: adding them is one rounding */
  target *targets;          /* those of a piece by node, in the order of the results */
  int32_t written, pieces, slots;
} cut;

static int by_piece(const void *x, const void *y) {
  const target *a = x, *b = y;
  if (a->piece != b->piece) return a->piece - b->piece;
  if (a->x != b->x) return a->x - b->x;
  return a->result != b->result ? a->result - b->result : a->first - b->first;
}

static cut cut_of(const graph *whole, int32_t backward, int32_t adds, int32_t fuses) {
  cut c = {.g = backward && fuses ? graph_fused(whole, adds) : copied(whole)};
  const graph *g = c.g;
  uint8_t *on = needed(g), *used = zeros(g->count, 1);
  int32_t y[3], room = 64, given = 0;
  c.order = taken(NULL, g->count * sizeof *c.order);
  c.home = filled(g->count, NONE), c.slot = filled(g->count, NONE);
  c.fused = zeros(g->count, 1);
  for (int64_t x = 0; x < g->count; x++) {
    if (!on[x] || leaf(g->nodes[x].op)) continue;
    c.home[x] = c.computed / MAX_STATEMENTS;
    c.order[c.computed++] = x;
    for (int k = operands(&g->nodes[x], y) - 1; k >= 0; k--) {
      used[y[k]] = 1;
      if (c.home[y[k]] != NONE && c.home[y[k]] != c.home[x]) c.slot[y[k]] = 0;
    }
  }
  if (backward && fuses && adds)
    for (int32_t i = 0; i < g->starts[g->outputs]; i++) {
      const int32_t x = g->results[i];
      c.fused[x] = g->nodes[x].op == op_mul && !used[x];
    }
  for (int64_t x = 0; x < g->count; x++)
    if (c.slot[x] != NONE) c.slot[x] = c.slots++;
  c.pieces = c.computed ? (c.computed - 1) / MAX_STATEMENTS + 1 : 1;
  c.targets = taken(NULL, room * sizeof *c.targets);
  for (int32_t r = 0; r < g->outputs; r++)
    for (int32_t i = g->starts[r]; i < g->starts[r + 1];) {
      const int32_t x = g->results[i];
      int32_t count = 1;
      while (i + count < g->starts[r + 1] && g->results[i + count] == x) count++;
      const int32_t run = g->nodes[x].op == op_const && count >= MIN_RUN; /* one loop writes them */
      for (int32_t k = 0; k < (run ? 1 : count); k++) {
        if (c.home[x] == NONE && ++given % MAX_STATEMENTS == 0) c.pieces++;
        if (c.written == room) c.targets = taken(c.targets, (room *= 2) * sizeof *c.targets);
        const int32_t piece = c.home[x] == NONE ? c.pieces - 1 : c.home[x];
        c.targets[c.written++] = (target){piece, x, r, i + k - g->starts[r], run ? count : 1};
      }
      i += count;
    }
  qsort(c.targets, c.written, sizeof *c.targets, by_piece);
  free(on), free(used);
  return c;
}

static void cut_free(cut *c) {
  graph_free(c->g);
  free(c->order), free(c->home), free(c->slot), free(c->fused), free(c->targets);
}

/* The first target of a piece at or after a node, by number. */
static int32_t target_at(const cut *c, int32_t piece, int32_t x) {
  int32_t low = 0, high = c->written;
  while (low < high) {
    const int32_t middle = (low + high) / 2;
    const target *t = &c->targets[middle];
    if (t->piece < piece || (t->piece == piece && t->x < x)) low = middle + 1;
    else high = middle;
  }
  return low;
}

static int is_target(const cut *c, int32_t t, int32_t piece, int32_t x) {
  return t < c->written && c->targets[t].piece == piece && c->targets[t].x == x;
}

/* --- C text --- */

typedef struct {
  char *at;
  size_t size, room;
} text;

static void append(text *t, const char *from, size_t size) {
  if (t->size + size + 1 > t->room) t->at = taken(t->at, t->room = 2 * (t->size + size + 1));
  memcpy(t->at + t->size, from, size);
  t->at[t->size += size] = 0;
}

static void say(text *t, const char *from) { append(t, from, strlen(from)); }

static void say_number(text *t, const char *before, int64_t value) {
  char digits[24];
  say(t, before);
  append(t, digits, snprintf(digits, sizeof digits, "%lld", (long long)value));
}

static void clear(text *t) {
  t->size = 0;
  if (t->at) t->at[0] = 0;
}

/* Fill a template: {0} to {2} are operands; \1 s \1 is the word times s; \2, \3 and \4 are values. */
static void fill(text *t, const char *form, const char *const *operand, int64_t word, const char *const *value) {
  for (; *form; form++) {
    if (*form == '{' && form[1] >= '0' && form[1] <= '2' && form[2] == '}') {
      say(t, operand[form[1] - '0']);
      form += 2;
    } else if (*form == 1) {
      say_number(t, "", word * strtoll(form + 1, (char **)&form, 10));
    } else if (*form >= 2 && *form <= 4) {
      say(t, value[*form - 2]);
    } else append(t, form, 1);
  }
}

static void say_literal(text *t, double value) {
  char digits[40];
  if (value != value) return say(t, "S(NAN)");
  if (isinf(value)) return say(t, value < 0 ? "S(-INFINITY)" : "S(INFINITY)");
  for (int precision = 15; precision <= 17; precision++) {
    snprintf(digits, sizeof digits, "%.*g", precision, value);
    if (strtod(digits, NULL) == value) break;
  }
  say(t, "S("), say(t, digits);
  if (!strpbrk(digits, ".e")) say(t, ".0");
  say(t, ")");
}

/* How C is written: see emit/writer.py, which fills these. */
typedef struct {
  const char *const *forms; /* by operation */
  const char *both;         /* sine and cosine at once; empty: never */
  const char *const *load;  /* of each argument: a word */
  const char *const *read;  /* of each result: a word */
  const char *const *store, *const *loop, *const *add, *const *add_loop, *const *add_product; /* of each result */
  const uint8_t *apart;     /* of each result whether it meets no other */
  const char *head, *name, *parameters, *last;
  int64_t ahead;
} style;

/* Statements in groups: of each first all loads, then what is computed, then all stores and sums. */
typedef struct {
  text done, loads, computed, stores, sums;
  int64_t ahead, waiting, count; /* loads that wait; sums of the function */
} lines;

static void close_group(lines *l) {
  text *const parts[] = {&l->loads, &l->computed, &l->stores, &l->sums};
  for (int i = 0; i < 4; i++) {
    if (parts[i]->size) append(&l->done, parts[i]->at, parts[i]->size);
    clear(parts[i]);
  }
  l->waiting = 0;
}

static void next_line(lines *l) {
  if (l->waiting >= l->ahead) close_group(l);
}

#define START "\n  "

/* Add to a word that no other name leads to, once. */
static void add_up(lines *l, const style *s, int32_t r, int32_t word, const char *value) {
  char name[24];
  snprintf(name, sizeof name, "s%lld", (long long)l->count++);
  say(&l->loads, START "V "), say(&l->loads, name), say(&l->loads, " = ");
  fill(&l->loads, s->read[r], NULL, word, NULL), say(&l->loads, ";");
  say(&l->computed, START), say(&l->computed, name), say(&l->computed, " += ");
  say(&l->computed, value), say(&l->computed, ";");
  say(&l->sums, START), fill(&l->sums, s->read[r], NULL, word, NULL);
  say(&l->sums, " = "), say(&l->sums, name), say(&l->sums, ";");
  l->waiting++;
  next_line(l);
}

typedef struct {
  const cut *c;
  const style *s;
  lines *l;
  int32_t *named, piece; /* the piece that has loaded or computed a node */
  int32_t adds;
  text value[3];
} writer;

static const char *type_of(int op) { return is_mask(op) ? "I" : "V"; }

/* Write the C name of a value; one from another piece is loaded first. */
static void use(writer *w, int32_t x, text *name) {
  const node *n = &w->c->g->nodes[x];
  clear(name);
  if (n->op == op_const) return say_literal(name, value_of(n));
  if (w->named[x] != w->piece) {
    text *to = &w->l->loads;
    say(to, START "const "), say(to, type_of(n->op)), say_number(to, " v", x);
    say(to, " = ("), say(to, type_of(n->op)), say(to, ")");
    if (n->op == op_input) fill(to, w->s->load[n->a], NULL, n->b, NULL);
    else say_number(to, "w[", w->c->slot[x]), say(to, "]");
    say(to, ";");
    w->named[x] = w->piece, w->l->waiting++;
    next_line(w->l);
  }
  say_number(name, "v", x);
}

static void write_targets(writer *w, int32_t x, const char *value) {
  const node *n = &w->c->g->nodes[x];
  const char *values[3] = {value, "", ""};
  if (w->adds && n->op == op_const && value_of(n) == 0) return;
  for (int32_t i = target_at(w->c, w->piece, x); is_target(w->c, i, w->piece, x); i++) {
    const target t = w->c->targets[i];
    if (w->adds && t.count == 1 && w->s->apart[t.result]) {
      add_up(w->l, w->s, t.result, t.first, value);
      continue;
    }
    text *to = &w->l->stores;
    say(to, START);
    if (t.count > 1) {
      say_number(to, "for (int j = ", t.first), say_number(to, "; j < ", t.first + t.count), say(to, "; j++) ");
      fill(to, (w->adds ? w->s->add_loop : w->s->loop)[t.result], NULL, 0, values);
    } else fill(to, (w->adds ? w->s->add : w->s->store)[t.result], NULL, t.first, values);
    next_line(w->l);
  }
}

/* Of the sines and cosines of a piece find those of the same number: the other of the two, or NONE. */
static int32_t *pairs(const cut *c, int32_t begin, int32_t end, int on) {
  int32_t *other = filled(c->g->count, NONE), *sine = filled(c->g->count, NONE), *cosine = filled(c->g->count, NONE);
  for (int32_t i = begin; on && i < end; i++) {
    const node *n = &c->g->nodes[c->order[i]];
    if (n->op == op_sin) sine[n->a] = c->order[i];
    if (n->op == op_cos) cosine[n->a] = c->order[i];
  }
  for (int32_t i = begin; on && i < end; i++) {
    const int32_t a = c->g->nodes[c->order[i]].a;
    if (a == NONE || sine[a] == NONE || cosine[a] == NONE) continue;
    other[sine[a]] = cosine[a], other[cosine[a]] = sine[a];
  }
  free(sine), free(cosine);
  return other;
}

static void write_piece(writer *w) {
  const cut *c = w->c;
  const graph *g = c->g;
  const int32_t begin = w->piece * MAX_STATEMENTS;
  const int32_t end = begin + MAX_STATEMENTS < c->computed ? begin + MAX_STATEMENTS : c->computed;
  int32_t *other = pairs(c, begin, end, w->s->both[0] != 0), y[3];
  char own[24], pair[24];
  lines *l = w->l;
  for (int32_t i = begin; i < end; i++) {
    const int32_t x = c->order[i];
    const node *n = &g->nodes[x];
    const int count = operands(n, y);
    for (int k = 0; k < count; k++) use(w, y[k], &w->value[k]);
    const char *given[3] = {w->value[0].at, w->value[1].at, w->value[2].at};
    if (c->fused[x]) {
      const char *product[3] = {"", given[0], given[1]};
      for (int32_t t = target_at(c, w->piece, x); is_target(c, t, w->piece, x); t++) {
        say(&l->stores, START);
        fill(&l->stores, w->s->add_product[c->targets[t].result], NULL, c->targets[t].first, product);
        next_line(l);
      }
      continue;
    }
    snprintf(own, sizeof own, "v%d", x);
    if (other[x] == NONE) {
      say(&l->computed, START "const "), say(&l->computed, type_of(n->op));
      say(&l->computed, " "), say(&l->computed, own), say(&l->computed, " = ");
      fill(&l->computed, w->s->forms[n->op], given, 0, NULL), say(&l->computed, ";");
      next_line(l);
    } else if (w->named[other[x]] != w->piece) {
      snprintf(pair, sizeof pair, "v%d", other[x]);
      const char *both[3] = {given[0], n->op == op_sin ? own : pair, n->op == op_sin ? pair : own};
      say(&l->computed, START "V "), say(&l->computed, both[1]), say(&l->computed, ", "), say(&l->computed, both[2]);
      say(&l->computed, "; "), fill(&l->computed, w->s->both, both, 0, NULL), say(&l->computed, ";");
      next_line(l);
    }
    w->named[x] = w->piece;
    if (c->slot[x] != NONE) {
      say_number(&l->computed, START "w[", c->slot[x]), say(&l->computed, "] = (V)");
      say(&l->computed, own), say(&l->computed, ";");
      next_line(l);
    }
    write_targets(w, x, own);
  }
  for (int32_t t = target_at(c, w->piece, 0); t < c->written && c->targets[t].piece == w->piece;) {
    const int32_t x = c->targets[t].x;
    if (c->home[x] == NONE) { /* results that are arguments come after all that is computed */
      use(w, x, &w->value[0]);
      write_targets(w, x, w->value[0].at);
    }
    while (is_target(c, t, w->piece, x)) t++;
  }
  free(other);
}

/* Return the C functions of all pieces of a graph, ``name_0`` and so on; to be freed by ``text_free``. */
char *graph_write(const graph *whole, const style *s, int32_t adds, int32_t backward, int32_t fuses, int32_t *pieces,
                  int32_t *slots) {
  cut c = cut_of(whole, backward, adds, fuses);
  text all = {0};
  lines l = {.ahead = s->ahead};
  writer w = {.c = &c, .s = s, .l = &l, .named = filled(c.g->count, NONE), .adds = adds};
  for (int k = 0; k < 3; k++) say(&w.value[k], "");
  for (w.piece = 0; w.piece < c.pieces; w.piece++) {
    say(&all, s->head), say(&all, " "), say(&all, s->name), say_number(&all, "_", w.piece);
    say(&all, "("), say(&all, s->parameters), say(&all, ") {" START "(void)w;");
    l.count = 0;
    write_piece(&w);
    close_group(&l);
    append(&all, l.done.at, l.done.size);
    clear(&l.done);
    if (w.piece == c.pieces - 1) say(&all, s->last);
    say(&all, "\n}\n");
  }
  *pieces = c.pieces, *slots = c.slots;
  free(l.sums.at), free(l.done.at), free(l.loads.at), free(l.computed.at), free(l.stores.at);
  for (int k = 0; k < 3; k++) free(w.value[k].at);
  free(w.named), cut_free(&c);
  return all.at;
}

void text_free(char *t) { free(t); }

/* --- codes for the interpreter, see emit/codes.py --- */

typedef struct {
  uint32_t *words;
  int64_t count, room;
  graph *known; /* its nodes are the constants: each once */
} codes;

enum { WORD_BITS = 21, CONSTANTS = 1, PLACES = 2, MAX_REGISTERS = 4096 };
enum { code_end, code_copy, code_add_to, code_fill, OWN_CODES };

codes *codes_new(void) {
  codes *c = zeros(1, sizeof *c);
  c->known = fresh(0, NULL);
  return c;
}

void codes_free(codes *c) {
  if (c) graph_free(c->known), free(c->words), free(c);
}

int64_t codes_count(const codes *c) { return c->count; }
int64_t codes_constants(const codes *c) { return c->known->count; }

void codes_read(const codes *c, uint32_t *words, double *constants) {
  if (c->count) memcpy(words, c->words, c->count * sizeof *words);
  for (int64_t i = 0; i < c->known->count; i++) constants[i] = value_of(&c->known->nodes[i]);
}

static void code(codes *c, int count, ...) {
  va_list given;
  if (c->count + count > c->room) c->words = taken(c->words, (c->room = 2 * (c->count + count)) * sizeof *c->words);
  va_start(given, count);
  for (int i = 0; i < count; i++) c->words[c->count++] = va_arg(given, uint32_t);
  va_end(given);
}

static uint32_t code_constant(codes *c, double value) { return CONSTANTS << WORD_BITS | constant(c->known, value); }

/* The number of an operation among codes: all but given numbers have one. */
static uint32_t code_of(int op) { return OWN_CODES + op - op_neg; }

static uint32_t operand_code(codes *c, const graph *g, int32_t x, const int32_t *where) {
  const node *n = &g->nodes[x];
  if (n->op == op_const) return code_constant(c, value_of(n));
  if (n->op == op_input) return (uint32_t)(PLACES + n->a) << WORD_BITS | n->b;
  return where[x];
}

static void store_codes(codes *c, const cut *w, int32_t piece, int32_t x, const int32_t *where, int32_t adds) {
  const node *n = &w->g->nodes[x];
  if (adds && n->op == op_const && value_of(n) == 0) return;
  const uint32_t value = operand_code(c, w->g, x, where);
  for (int32_t i = target_at(w, piece, x); is_target(w, i, piece, x); i++) {
    const target t = w->targets[i];
    const uint32_t to = (uint32_t)(PLACES + w->g->arguments + t.result) << WORD_BITS | t.first;
    if (t.count > 1 && !adds) code(c, 4, code_fill, to, value, t.count);
    else
      for (int32_t k = 0; k < t.count; k++) code(c, 3, adds ? code_add_to : code_copy, to + k, value);
  }
}

/* Add the codes of a function; 1: it is too large, 2: it keeps too many values. */
int32_t codes_add(codes *c, const graph *whole, int32_t primal, int32_t adds, int32_t backward, int32_t clears,
                  int32_t shared) {
  cut w = cut_of(whole, backward, adds, 1);
  const graph *g = w.g;
  const int32_t places = g->arguments + g->outputs;
  int32_t largest = 0, status = 0, kept = 0, free_count = 0, y[3];
  for (int32_t i = 0; i < g->arguments; i++) largest = g->sizes[i] > largest ? g->sizes[i] : largest;
  for (int32_t i = 0; i < g->outputs; i++)
    largest = g->starts[i + 1] - g->starts[i] > largest ? g->starts[i + 1] - g->starts[i] : largest;
  if (places + PLACES >= 1 << (32 - WORD_BITS) || largest >= 1 << WORD_BITS) {
    cut_free(&w);
    return 1;
  }
  const int64_t start = c->count;
  int32_t *read = zeros(g->arguments, sizeof *read), *where = filled(g->count, NONE), *ends = filled(g->count, NONE);
  int32_t *open = taken(NULL, (g->count + 1) * sizeof *open);
  uint8_t *on = needed(g);
  for (int64_t x = 0; shared && x < g->count; x++) {
    const node *n = &g->nodes[x];
    if (on[x] && n->op == op_input && n->b >= read[n->a]) read[n->a] = n->b + 1;
  }
  code(c, 4, places, 1, 0, 0);
  for (int32_t i = 0; i < g->arguments; i++) code(c, 1, i >= primal ? 1 : shared ? 2 + read[i] : 0);
  for (int32_t i = 0; i < g->outputs; i++) code(c, 1, backward ? 1 : 0);
  for (int32_t i = 0; i < w.computed; i++)
    for (int k = operands(&g->nodes[w.order[i]], y) - 1; k >= 0; k--) ends[y[k]] = w.order[i];
  for (int32_t piece = 0; piece < w.pieces; piece++) {
    const int32_t begin = piece * MAX_STATEMENTS;
    const int32_t end = begin + MAX_STATEMENTS < w.computed ? begin + MAX_STATEMENTS : w.computed;
    for (int32_t i = begin; i < end; i++) {
      const int32_t x = w.order[i];
      const int count = operands(&g->nodes[x], y);
      uint32_t from[3];
      for (int k = 0; k < count; k++) from[k] = operand_code(c, g, y[k], where);
      for (int k = 0; k < count; k++) /* values that nothing later takes leave their place */
        if (ends[y[k]] == x && where[y[k]] != NONE) open[free_count++] = where[y[k]], where[y[k]] = NONE;
      if (w.fused[x]) {
        for (int32_t t = target_at(&w, piece, x); is_target(&w, t, piece, x); t++) {
          const uint32_t to = (uint32_t)(PLACES + g->arguments + w.targets[t].result) << WORD_BITS | w.targets[t].first;
          code(c, 5, code_of(op_fma), to, from[0], from[1], to);
        }
        continue;
      }
      where[x] = free_count ? open[--free_count] : kept++;
      code(c, 2, code_of(g->nodes[x].op), where[x]);
      for (int k = 0; k < count; k++) code(c, 1, from[k]);
      store_codes(c, &w, piece, x, where, adds);
      if (ends[x] == NONE) open[free_count++] = where[x];
    }
    for (int32_t t = target_at(&w, piece, 0); t < w.written && w.targets[t].piece == piece;) {
      const int32_t x = w.targets[t].x;
      if (w.home[x] == NONE) store_codes(c, &w, piece, x, where, adds);
      while (is_target(&w, t, piece, x)) t++;
    }
  }
  for (int32_t a = primal; clears && a < g->arguments; a++)
    if (g->sizes[a]) code(c, 4, code_fill, (uint32_t)(PLACES + a) << WORD_BITS, code_constant(c, 0.0), g->sizes[a]);
  code(c, 1, code_end);
  int64_t all = kept;
  for (int32_t i = 0; i < primal && i < g->arguments; i++) all += read[i];
  if (all > MAX_REGISTERS) status = 2;
  c->words[start + 1] = all ? all : 1;
  free(read), free(where), free(ends), free(open), free(on), cut_free(&w);
  return status;
}
