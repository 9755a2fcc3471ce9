/* Calls whose guard is 0 in all lanes are left out. See emit/guarding.py for the data. */
#include <stdlib.h>

static void run(const phase *calls, V *m, V *b, word k) {
  const word *t = calls->entries;
  for (word c = 0; c < calls->count; c++, t += t[1]) FUNCTIONS[t[0]](m, b, t + 2, k);
}

typedef struct { word count; word *entries; } calls_left;

typedef struct {
  char *on, *needed, *seen; /* by guard: in the tables, needed in a step; needed by step and guard */
  word *at;                 /* by alias: offset and stride of where it is */
  calls_left body, again, back_body;
  int forward, backward;    /* whether the tables of a direction have what ``on`` says */
} left_out;

static word words_of(const phase *calls) {
  const word *t = calls->entries;
  for (word c = 0; c < calls->count; c++) t += t[1];
  return t - calls->entries;
}

static calls_left room(const phase *calls) {
  calls_left r = {0, malloc(sizeof(word) * (1 + words_of(calls)))};
  return r;
}

static void place_aliases(const program *p, left_out *x) {
  const word *a = p->aliases.places;
  for (word i = 0; i < p->aliases.count; i++, a += 5) {
    word *at = x->at + 2 * i;
    if (x->on[a[0]]) at[0] = a[1], at[1] = 0;
    else if (a[2] >= 0) at[0] = x->at[2 * a[2]], at[1] = x->at[2 * a[2] + 1];
    else at[0] = a[3], at[1] = a[4];
  }
}

static left_out begin_guards(const program *p, int gradient) {
  left_out x = {0};
  word guards = p->guards.count;
  if (!guards) return x;
  x.on = calloc(2 + (gradient ? p->steps : 0), guards);
  x.needed = x.on + guards;
  x.seen = gradient ? x.needed + guards : 0;
  x.at = malloc(sizeof(word) * (1 + 2 * p->aliases.count));
  x.body = room(&p->body);
  place_aliases(p, &x);
  if (gradient) {
    x.again = room(&p->again);
    x.back_body = room(&p->back_body);
  }
  return x;
}

static void end_guards(left_out *x) {
  free(x->on);
  free(x->at);
  free(x->body.entries);
  free(x->again.entries);
  free(x->back_body.entries);
}

/* The calls from the given one on that are left, with the places where their arguments and results are. */
static void write_left(calls_left *to, const phase *calls, const word *marks, const left_out *x, word from) {
  const word *t = calls->entries, *mark = marks;
  word *out = to->entries, c = 0;
  to->count = 0;
  for (; c < from; c++) {
    mark += t[1];
    t += t[1];
  }
  for (; c < calls->count; c++) {
    word length = t[1];
    if (mark[0] < 0 || x->on[mark[0]]) {
      out[0] = t[0];
      out[1] = length;
      for (word i = 2; i < length; i += 2) {
        const word *where = mark[i] < 0 ? t + i : x->at + 2 * mark[i];
        out[i] = where[0];
        out[i + 1] = where[1];
      }
      out += length;
      to->count++;
    }
    mark += length;
    t += length;
  }
}

/* Tables have all that is needed, and may have more: what has no effect may run. Those of before stay in for a while. */
static void take_in(const program *p, left_out *x, const char *needed) {
  word guards = p->guards.count, missing = 0, wanted = 0, both = 0;
  for (word i = 0; i < guards; i++) {
    missing += needed[i] && !x->on[i];
    wanted += needed[i];
    both += needed[i] || x->on[i];
  }
  if (!missing) return;
  int keep = both <= wanted + wanted / 4 + 4;
  for (word i = 0; i < guards; i++) x->on[i] = needed[i] || (keep && x->on[i]);
  place_aliases(p, x);
  x->forward = x->backward = 0;
}

static void look(const program *p, const V *m, char *needed) {
  for (word i = 0; i < p->guards.count; i++) {
    const V *guard = m + p->guards.places[i];
    char any = 0;
    for (word l = 0; l < LANES; l++) any |= LANE(*guard, l) != 0;
    needed[i] = any;
  }
}

static void step_left(const program *p, left_out *x, V *m, word k) {
  phase first = {p->first, p->body.entries};
  run(&first, m, 0, k);
  char *needed = x->seen ? x->seen + k * p->guards.count : x->needed;
  look(p, m, needed);
  take_in(p, x, needed);
  if (!x->forward) write_left(&x->body, &p->body, p->body_marks, x, p->first);
  x->forward = 1;
  phase left = {x->body.count, x->body.entries};
  run(&left, m, 0, k);
}

static void back_left(const program *p, left_out *x, V *m, V *b, word k) {
  take_in(p, x, x->seen + k * p->guards.count);
  if (!x->backward) {
    write_left(&x->again, &p->again, p->again_marks, x, 0);
    write_left(&x->back_body, &p->back_body, p->back_marks, x, 0);
    x->backward = 1;
  }
  phase again = {x->again.count, x->again.entries}, back = {x->back_body.count, x->back_body.entries};
  run(&again, m, 0, k);
  run(&back, m, b, k);
}
