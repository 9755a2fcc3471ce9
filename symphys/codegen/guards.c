/* Calls that are without effect are left out; emit/guarding.py says what the data mean. What the driver notes lies behind
   the adjoints and stays from one evaluation to the next: ``prepare`` begins it. */
#include <string.h>

#ifndef CALL
#define CALL(t, m, b, k) FUNCTIONS[(t)[0]](m, b, (t) + 2, k)
#endif
#ifndef LOWEST
static int LOWEST(unsigned long long bits) {
  int lowest = 0;
  for (; !(bits & 1); bits >>= 1) lowest++;
  return lowest;
}
#endif

#ifndef PREFETCH
#define PREFETCH(place) ((void)(place))
#endif

#define AHEAD 16 /* calls, of which it is asked before they are noted */
#define SOON 2 /* steps to come of which lists have all that is needed, backwards: fewer lists, and few calls more */

typedef struct {
  word forward, backward;   /* whether the lists of a direction have what is on */
  char *on, *needed, *seen; /* by guard: in the lists, needed in a step; by step and guard: needed */
  unsigned long long *runs; /* a bit for each call */
  word *listed;             /* numbers of the calls that run */
  word *tables, *current;   /* entries of all tables; by chain: offset and stride of its newest */
  word *jumps, *copied;     /* by table and section: 6; by table: offset, source and its stride, size */
  const word **items[3];
  word counts[3], starts[3], copies[3];
} left_out;

static void run(const phase *calls, V *m, V *b, word k) {
  const word *t = calls->entries;
  for (word c = 0; c < calls->count; c++, t += t[1]) CALL(t, m, b, k);
}

static left_out *left_of(const program *p, V *m) {
  uintptr_t end = (uintptr_t)(m + 2 * p->size + p->tape), word_size = sizeof(word);
  return (left_out *)((end + word_size - 1) / word_size * word_size);
}

static word length_of(const phase *calls) {
  const word *t = calls->entries;
  for (word c = 0; c < calls->count; c++) t += t[1];
  return t - calls->entries;
}

API void prepare(const program *p, V *m) {
  left_out *x = left_of(p, m);
  word guards = p->guards.count, calls = p->calls.count, sections = p->sections.count, words = 0;
  word *free = (word *)x + 64;
  const phase *tables[3] = {&p->body, &p->again, &p->back_body};
  memset(x, 0, 64 * sizeof(word));
  x->on = (char *)free;
  x->needed = x->on + guards;
  x->seen = x->needed + guards;
  memset(x->on, 0, 2 * guards);
  free += (2 + p->steps) * guards / 8 + 1;
  x->runs = (unsigned long long *)free;
  free += calls / 64 + 1;
  x->listed = free;
  free += calls + AHEAD;
  x->tables = free;
  for (word i = 0; i < 3; i++) {
    word length = length_of(tables[i]);
    memcpy(x->tables + words, tables[i]->entries, length * sizeof(word));
    words += length;
  }
  free += words;
  x->current = free;
  free += 2 * p->chains.count;
  for (word i = 0; i < 3; i++) {
    x->items[i] = (const word **)free;
    free += calls + sections;
  }
  x->jumps = free;
  x->copied = free + 3 * 6 * sections;
}

/* Which calls run: those without a guard, and those whose guard is on; their numbers, in order. */
static word list_runs(const program *p, left_out *x) {
  const word *end = p->groups.places, *call = end + p->guards.count + 1, *calls = call;
  word count = 0;
  memset(x->runs, 0, (p->calls.count / 64 + 1) * sizeof(*x->runs));
  for (word g = 0; g <= p->guards.count; g++)
    if (g < p->guards.count && !x->on[g]) call = calls + end[g];
    else
      for (; call < calls + end[g]; call++) x->runs[*call / 64] |= 1ull << (*call % 64);
  for (word block = 0; block <= p->calls.count / 64; block++)
    for (unsigned long long left = x->runs[block]; left; left &= left - 1)
      x->listed[count++] = 64 * block + LOWEST(left);
  for (word i = 0; i < AHEAD; i++) x->listed[count + i] = p->calls.count - 1;
  return count;
}

/* What is noted of a call lies here and there in a memory of many calls: it is asked for some calls before. */
static void ask(const program *p, const left_out *x, const word *next, int backward) {
  const word *far = p->calls.places + 7 * next[AHEAD - 1], *near = p->calls.places + 7 * next[AHEAD / 2 - 1];
  PREFETCH(far);
  PREFETCH(far + 13);
  word from = backward ? near[4] : near[3], to = near[backward ? 10 : 4];
  for (word i = from; i < to && i < from + 12; i += 4) PREFETCH(p->reads.places + 2 * i);
  const word *soon = p->calls.places + 7 * next[AHEAD / 4 - 1];
  for (word i = soon[backward ? 4 : 3]; i < soon[backward ? 10 : 4]; i++) {
    const word *r = p->reads.places + 2 * i;
    PREFETCH(x->tables + r[0]);
    PREFETCH(x->current + 2 * r[1]);
  }
}

static void place(const left_out *x, const word *source, word *to) {
  to[0] = source[0] < 0 ? source[1] : x->current[2 * source[0]] + source[1];
  to[1] = source[0] < 0 ? source[2] : x->current[2 * source[0] + 1];
}

static void redirect(const program *p, left_out *x, word from, word to) {
  const word *r = p->reads.places + 2 * from;
  for (word i = from; i < to; i++, r += 2) {
    x->tables[r[0]] = x->current[2 * r[1]];
    x->tables[r[0] + 1] = x->current[2 * r[1] + 1];
  }
}

static void append(const program *p, left_out *x, word table, const word *call) {
  if (call[table] < 0) return;
  const word *entry = x->tables + call[table];
  if (table < 2) x->items[table][x->counts[table]] = entry;
  else x->items[2][p->calls.count + p->sections.count - 1 - x->counts[2]] = entry;
  x->counts[table]++;
  const word *c = p->copies.places + 5 * call[6];
  for (word i = call[6]; i < call[13]; i++, c += 5) {
    word *to = x->copied + 4 * (table * p->copies.count + x->copies[table]++);
    to[0] = c[0];
    place(x, c + 1, to + 1);
    to[3] = c[4];
  }
}

/* A jump comes before what it leaves out: in the first two tables as a section begins, backwards as it ends. */
static void begin_section(const program *p, left_out *x, word table, word s) {
  word *jump = x->jumps + 6 * (table * p->sections.count + s);
  jump[0] = -1;
  place(x, p->sections.places + 5 * s + 2, jump + 1);
  jump[3] = -x->counts[table];
  jump[4] = x->copies[table];
  if (table < 2) {
    x->items[table][x->counts[table]++] = jump;
    jump[3]--;
  }
}

static void end_section(const program *p, left_out *x, word table, word s) {
  word *jump = x->jumps + 6 * (table * p->sections.count + s);
  jump[3] += x->counts[table];
  jump[5] = x->copies[table];
  if (table == 2) x->items[2][p->calls.count + p->sections.count - 1 - x->counts[2]++] = jump;
}

static void note(const program *p, left_out *x, int backward) {
  word from = backward ? 1 : 0, to = backward ? 3 : 1, s = 0, inside = 0;
  memcpy(x->current, p->chains.places, 2 * p->chains.count * sizeof(word));
  for (word t = from; t < to; t++) x->counts[t] = x->copies[t] = 0;
  word count = list_runs(p, x);
  for (word i = 0; i < count; i++) {
    word k = x->listed[i];
    ask(p, x, x->listed + i + 1, backward);
    const word *call = p->calls.places + 7 * k, *section = p->sections.places + 5 * s;
    for (; s < p->sections.count && k >= section[1]; inside = 0, s++, section += 5)
      for (word t = from; inside && t < to; t++) end_section(p, x, t, s);
    if (s < p->sections.count && !inside && k >= section[0]) {
      for (word t = from; t < to; t++) begin_section(p, x, t, s);
      inside = 1;
    }
    if (backward || k >= p->first) {
      redirect(p, x, backward ? call[4] : call[3], backward ? call[10] : call[4]);
      for (word t = from; t < to; t++) append(p, x, t, call);
    }
    const word *w = p->writes.places + 2 * call[5];
    for (word i = call[5]; i < call[12]; i++, w += 2) x->current[2 * w[0]] = w[1], x->current[2 * w[0] + 1] = 0;
  }
  if (inside)
    for (word t = from; t < to; t++) end_section(p, x, t, s);
  for (word t = from; t < to; t++) x->starts[t] = t < 2 ? 0 : p->calls.count + p->sections.count - x->counts[2];
}

static int any(const V *word_of) {
  for (word l = 0; l < LANES; l++)
    if (LANE(*word_of, l) != 0) return 1;
  return 0;
}

static void skip(const left_out *x, const word *copied, const word *jump, V *m, V *b, word k) {
  if (b)
    for (const word *c = copied + 4 * (jump[5] - 1); c >= copied + 4 * jump[4]; c -= 4)
      for (word w = 0; w < c[3]; w++) b[c[1] + k * c[2] + w] += b[c[0] + w], b[c[0] + w] = S(0.0);
  else
    for (const word *c = copied + 4 * jump[4]; c < copied + 4 * jump[5]; c += 4)
      for (word w = 0; w < c[3]; w++) m[c[0] + w] = m[c[1] + k * c[2] + w];
}

static void run_left(const program *p, const left_out *x, word table, V *m, V *b, word k) {
  const word **items = x->items[table] + x->starts[table], *copied = x->copied + 4 * table * p->copies.count;
  for (word i = 0; i < x->counts[table]; i++) {
    const word *t = items[i];
    if (t[0] >= 0) CALL(t, m, b, k);
    else if (!any(m + t[1] + k * t[2])) skip(x, copied, t, m, b, k), i += t[3];
  }
}

/* Lists have all that is needed, and may have more: what has no effect may run. So what is there stays for a while, and
   what ``soon`` steps before this one needed comes in. */
static void take_in(const program *p, left_out *x, const char *needed, word soon) {
  word guards = p->guards.count, missing = 0, wanted = 0, both = 0;
  for (word i = 0; i < guards; i++) {
    missing += needed[i] && !x->on[i];
    wanted += needed[i];
    both += needed[i] || x->on[i];
  }
  if (!missing) return;
  int keep = both <= wanted + wanted / 8 + 1;
  for (word i = 0; i < guards; i++) {
    x->on[i] = needed[i] || (keep && x->on[i]);
    for (word j = 1; j <= soon; j++) x->on[i] |= needed[i - j * guards];
  }
  x->forward = x->backward = 0;
}

static void step_left(const program *p, V *m, word k, int gradient) {
  const phase first = {p->first, p->body.entries};
  left_out *x = left_of(p, m);
  char *needed = gradient ? x->seen + k * p->guards.count : x->needed;
  run(&first, m, 0, k);
  for (word i = 0; i < p->guards.count; i++) needed[i] = (char)any(m + p->guards.places[i]);
  take_in(p, x, needed, 0);
  if (!x->forward) note(p, x, 0);
  x->forward = 1;
  run_left(p, x, 0, m, 0, k);
}

static void back_left(const program *p, V *m, V *b, word k) {
  left_out *x = left_of(p, m);
  take_in(p, x, x->seen + k * p->guards.count, k < SOON ? k : SOON);
  if (!x->backward) note(p, x, 1);
  x->backward = 1;
  run_left(p, x, 1, m, 0, k);
  run_left(p, x, 2, m, b, k);
}
