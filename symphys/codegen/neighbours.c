/* Steps of many bodies: loops over bodies and over the pairs that are near, which each step finds anew. What the data
   mean is told in neighbours/plan.py. The lanes of a block are scenes, each with pairs of its own. */
#include <stdlib.h>
#include <string.h>

#define CALL(t, m, b, k) FUNCTIONS[(t)[0]](m, b, (t) + 2, k)

typedef struct { word work, state, members, base, from; } room; /* words of a member; where members begin */
typedef struct { word room, first, end, other, section; } loop;  /* of its actions; those in place of them end there */
typedef struct { word store, of, offset, pitch, at, size, entry, back, guard; } action; /* CALLED: a call, else a copy */
typedef struct { word first, second, plane; double normal[3], offset; } kind; /* species; -1: a plane */
typedef struct {
  word rooms, species, loops, words, state, given;
  word found, looked, striking; /* loops: before the first pairs are found, from the other on near ones are left; and where
                                   in the work of what is there once it says how far what strikes comes */
  const room *list;
  const loop *order;
  const action *actions;
  const word *entries, *back; /* of calls and of their adjoints */
  const kind *kinds;
  const word *sight, *nears; /* by species: where a position and a reach lie; by kind where in nears
                                words begin, of which one is not 0 if a pair is near */
} crowd;
typedef struct {
  word rows, steps;
  const double *start, *given; /* (rows, start), (rows, given) */
  double *states, *slopes;     /* (rows, steps + 1, shown); slopes: what they are weighed with, then that of the start */
  word shown, start_size;
  word *most;                  /* (kinds): pairs at most */
} scenes;

enum { WORK, BEFORE, AFTER, GIVEN, CALLED };
enum { OWN, FIRST, SECOND, ONCE, THEN, OUT = 8 };
/* before: the number of the same pair in the step before; -1: it was not near; -2: there is no pair in this lane */
typedef struct { int32_t first[LANES], second[LANES], before[LANES]; } near;

typedef struct {
  const crowd *c;
  V *m, *b, *x, *y, *given; /* work, its adjoints, states and their adjoints of all steps */
  near *pairs;              /* (steps, slots) */
  int32_t *used;            /* (steps, kinds) */
  int32_t *active, *count;  /* (slots) those that are near in the step, by kind; (kinds) how many */
  word slots;
  char *scratch;
} scene;

/* The number of the first pair of a room among all. */
static word slots_before(const crowd *c, word room) {
  word slots = 0;
  for (word r = 1 + c->species; r < room; r++) slots += c->list[r].members;
  return slots;
}

/* A copy in which each lane has members of its own; lanes without a pair have no effect. */
static NOINLINE void copy_lanes(const action *a, const near *p, V *there, V *here, int gains) {
  word out = a->of & OUT, of = a->of & ~OUT;
  for (word l = 0; l < LANES; l++) {
    word k = of == FIRST ? p->first[l] : of == SECOND ? p->second[l] : of == THEN ? p->before[l] : 0;
    if (k < 0 || (out && p->before[l] == -2)) {
      if (!out)
        for (word w = 0; w < a->size; w++) LANE(here[a->at + w], l) = 0;
      continue;
    }
    V *other = there + k * a->pitch, *own = here + a->at;
    for (word w = 0; w < a->size; w++)
      if (gains && out) LANE(own[w], l) += LANE(other[w], l), LANE(other[w], l) = 0;
      else if (gains) LANE(other[w], l) += LANE(own[w], l), LANE(own[w], l) = 0;
      else if (out) LANE(other[w], l) = LANE(own[w], l);
      else LANE(own[w], l) = LANE(other[w], l);
  }
}

static inline __attribute__((always_inline)) void copy(
    const action *a, const near *p, word i, V *const *stores, V *here, int gains) {
  V *there = stores[a->store] + a->offset, *own = here + a->at;
  word out = a->of & OUT, of = a->of & ~OUT;
#if LANES > 1
  if (of == FIRST || of == SECOND || of == THEN || (out && of == ONCE && p)) {
    copy_lanes(a, p, there, here, gains);
    return;
  }
  word k = of == OWN ? i : 0;
#else
  word k = of == OWN ? i : of == FIRST ? p->first[0] : of == SECOND ? p->second[0] : of == THEN ? p->before[0] : 0;
  if (k < 0) {
    memset(own, 0, a->size * sizeof(V));
    return;
  }
#endif
  there += k * a->pitch;
  for (word w = 0; w < a->size; w++)
    if (gains && out) own[w] += there[w], there[w] = S(0.0);
    else if (gains) there[w] += own[w], own[w] = S(0.0);
    else if (out) there[w] = own[w];
    else own[w] = there[w];
}

/* Which pairs may act: reaches and what strikes are at least what the calls go by. */
typedef struct { uint64_t key; int32_t first, second; } found;

static int by_key(const void *a, const void *b) {
  uint64_t x = ((const found *)a)->key, y = ((const found *)b)->key;
  return (x > y) - (x < y);
}

static double at(const scene *s, word body, word species, word which, word l) {
  const room *r = s->c->list + 1 + species;
  const word *sight = s->c->sight + 2 * species;
  word w = which < 3 ? sight[0] + which : sight[1];
  return LANE(s->m[r->base + body * r->work + w], l);
}

/* Places that are no numbers, or far beyond all others, share a cell. */
static int64_t cell_of(double x, double width) {
  double cell = __builtin_floor(x / width);
  return cell > -1e15 && cell < 1e15 ? (int64_t)cell : 0;
}

static int search(const scene *s, word k, word l, word *most) {
  const crowd *c = s->c;
  word kinds = c->rooms - 1 - c->species, bodies = 0;
  for (word q = 0; q < c->species; q++) bodies += c->list[1 + q].members;
  double (*seen)[4] = (double (*)[4])s->scratch;
  int64_t (*cells)[3] = (int64_t (*)[3])(seen + bodies);
  int32_t *whose = (int32_t *)(cells + bodies), *number = whose + bodies, *next = number + bodies, *heads = next + bodies;
  word buckets = 1;
  while (buckets < 2 * bodies) buckets *= 2;
  found *list = (found *)(((uintptr_t)(heads + buckets) + 7) / 8 * 8);
  double strikes = LANE(s->m[c->list[0].base + c->striking], l), width = 0;
  for (word q = 0, n = 0; q < c->species; q++)
    for (word i = 0; i < c->list[1 + q].members; i++, n++) {
      for (word w = 0; w < 4; w++) seen[n][w] = at(s, i, q, w, l);
      whose[n] = q, number[n] = i;
      if (seen[n][3] > width) width = seen[n][3];
    }
  width = 2 * width + strikes;
  memset(heads, -1, buckets * sizeof(*heads));
  word counts[kinds], starts[kinds], room = 0;
  for (word q = 0; q < kinds; q++) counts[q] = 0, starts[q] = room, room += c->list[1 + c->species + q].members;
#define PUT(q, i, j, lead) { \
    if (counts[q] < c->list[1 + c->species + q].members) \
      list[starts[q] + counts[q]] = (found){(uint64_t)(((i) + (j)) % bodies) * bodies + (lead), 0, 0}, \
      list[starts[q] + counts[q]].first = number[i], list[starts[q] + counts[q]].second = number[j]; \
    counts[q]++; \
  }
  for (word n = 0; n < bodies; n++) {
    for (word w = 0; w < 3; w++) cells[n][w] = cell_of(seen[n][w], width);
    for (word q = 0; q < kinds; q++) {
      const kind *e = c->kinds + q;
      if (e->plane < 0 || e->first != whose[n]) continue;
      double height = -e->offset;
      for (word w = 0; w < 3; w++) height += e->normal[w] * seen[n][w];
      if (!(height > seen[n][3] + strikes)) {
        if (counts[q] < c->list[1 + c->species + q].members)
          list[starts[q] + counts[q]] = (found){(uint64_t)n, number[n], number[n]};
        counts[q]++;
      }
    }
    for (int near_by = 0; near_by < 27; near_by++) {
      int64_t x = cells[n][0] + near_by % 3 - 1, y = cells[n][1] + near_by / 3 % 3 - 1, z = cells[n][2] + near_by / 9 - 1;
      uint64_t bucket = ((uint64_t)x * 73856093u ^ (uint64_t)y * 19349663u ^ (uint64_t)z * 83492791u) & (buckets - 1);
      for (int32_t o = heads[bucket]; o >= 0; o = next[o]) {
        if (cells[o][0] != x || cells[o][1] != y || cells[o][2] != z) continue;
        double square = 0, reach = seen[n][3] + seen[o][3] + strikes;
        for (word w = 0; w < 3; w++) square += (seen[n][w] - seen[o][w]) * (seen[n][w] - seen[o][w]);
        if (square > reach * reach * (1 + 1e-9)) continue;
        for (word q = 0; q < kinds; q++) {
          const kind *e = c->kinds + q;
          if (e->plane >= 0) continue;
          word i = -1, j = -1;
          if (e->first == whose[o] && e->second == whose[n]) i = o, j = n;
          else if (e->first == whose[n] && e->second == whose[o]) i = n, j = o;
          if (i < 0) continue;
          PUT(q, i, j, i)
          break;
        }
      }
    }
    uint64_t bucket = ((uint64_t)cells[n][0] * 73856093u ^ (uint64_t)cells[n][1] * 19349663u ^
                       (uint64_t)cells[n][2] * 83492791u) & (buckets - 1);
    next[n] = heads[bucket], heads[bucket] = n;
  }
  int fits = 1;
  for (word q = 0; q < kinds; q++) {
    word room_for = c->list[1 + c->species + q].members;
    if (counts[q] > most[q]) most[q] = counts[q];
    if (counts[q] > room_for) { fits = 0; continue; }
    qsort(list + starts[q], counts[q], sizeof(found), by_key);
    near *now = s->pairs + k * s->slots + starts[q], *then = now - s->slots;
    word j = 0, last = k ? s->used[(k - 1) * kinds + q] : 0;
    for (word i = 0; i < room_for; i++) {
      if (i >= counts[q]) {
        now[i].first[l] = 0, now[i].second[l] = c->kinds[q].plane < 0 && c->kinds[q].first == c->kinds[q].second;
        now[i].before[l] = -2;
        continue;
      }
      found f = list[starts[q] + i];
      now[i].first[l] = f.first, now[i].second[l] = f.second, now[i].before[l] = -1;
      for (; j < last; j++) {
        if (then[j].before[l] == -2) { j = last; break; }
        word a = then[j].first[l], z = then[j].second[l];
        uint64_t key = f.key;
        for (word w = 0; w < c->kinds[q].first; w++) a += c->list[1 + w].members;
        if (c->kinds[q].plane >= 0) key = (uint64_t)a;
        else {
          for (word w = 0; w < c->kinds[q].second; w++) z += c->list[1 + w].members;
          key = (uint64_t)((a + z) % bodies) * bodies + a;
        }
        if (key < f.key) continue;
        if (key == f.key) now[i].before[l] = j;
        break;
      }
    }
    if (counts[q] > s->used[k * kinds + q]) s->used[k * kinds + q] = counts[q];
  }
  return fits;
}

static int any(const V *word_of) {
  for (word l = 0; l < LANES; l++)
    if (LANE(*word_of, l) != 0) return 1;
  return 0;
}

/* The pairs that are near, as their own calls have found out. */
static void list_near(const scene *s, word k) {
  const crowd *c = s->c;
  word kinds = c->rooms - 1 - c->species;
  for (word q = 0; q < kinds; q++) {
    word room = 1 + c->species + q, first = slots_before(c, room), n = 0;
    const word *near_words = c->nears + c->nears[q], *end = c->nears + c->nears[q + 1];
    for (word i = 0; i < s->used[k * kinds + q]; i++) {
      const V *here = s->m + c->list[room].base + i * c->list[room].work;
      for (const word *w = near_words; w < end; w++)
        if (any(here + *w)) {
          s->active[first + n++] = i;
          break;
        }
    }
    s->count[q] = n;
  }
}

/* Which members a loop goes through, and its actions. */
typedef struct { word count; const int32_t *listed; const near *pairs; const action *first, *end; } round;

static round round_of(const scene *s, word n, word k) {
  const crowd *c = s->c;
  const loop *o = c->order + n;
  word kinds = c->rooms - 1 - c->species, q = o->room - 1 - c->species, slots = slots_before(c, o->room);
  int other = o->section >= 0 && !any(s->m + c->list[0].base + o->section);
  round r = {.first = c->actions + (other ? o->end : o->first), .end = c->actions + (other ? o->other : o->end)};
  if (q < 0) r.count = c->list[o->room].members;
  else {
    r.pairs = s->pairs + k * s->slots + slots;
    r.count = n < c->looked ? s->used[k * kinds + q] : s->count[q];
    if (n >= c->looked) r.listed = s->active + slots;
  }
  if (r.first == r.end) r.count = 0;
  return r;
}

static int step(const scene *s, word k, word *most) {
  const crowd *c = s->c;
  word kinds = c->rooms - 1 - c->species;
  V *stores[] = {s->m, s->x + k * c->state, s->x + (k + 1) * c->state, s->given};
  for (word n = 0; n < c->loops; n++) {
    if (n == c->found && most) {
      memset(s->used + k * kinds, 0, kinds * sizeof(*s->used));
      for (word l = 0; l < LANES; l++)
        if (!search(s, k, l, most)) return 0;
    }
    if (n == c->looked) list_near(s, k);
    round r = round_of(s, n, k);
    const room *own = c->list + c->order[n].room;
    for (word j = 0; j < r.count; j++) {
      word i = r.listed ? r.listed[j] : j;
      V *here = s->m + own->base + i * own->work;
      const near *p = r.pairs ? r.pairs + i : 0;
      for (const action *a = r.first; a < r.end; a++)
        if (a->guard >= 0 && !any(here + a->guard)) {
          if (a->store == CALLED) memset(here + a->at, 0, a->size * sizeof(V));
        } else if (a->store == CALLED) CALL(c->entries + a->entry, here, 0, 0);
        else copy(a, p, i, stores, here, 0);
    }
  }
  return 1;
}

static void step_back(const scene *s, word k) {
  const crowd *c = s->c;
  V *stores[] = {s->b, s->y + k * c->state, s->y + (k + 1) * c->state, 0};
  for (word n = c->loops - 1; n >= 0; n--) {
    round r = round_of(s, n, k);
    const room *own = c->list + c->order[n].room;
    for (word j = r.count - 1; j >= 0; j--) {
      word i = r.listed ? r.listed[j] : j;
      V *here = s->m + own->base + i * own->work, *gains = s->b + own->base + i * own->work;
      const near *p = r.pairs ? r.pairs + i : 0;
      for (const action *a = r.end - 1; a >= r.first; a--)
        if (a->guard >= 0 && !any(here + a->guard)) {
          if (a->store == CALLED) memset(gains + a->at, 0, a->size * sizeof(V));
        } else if (a->store == CALLED && a->back >= 0) CALL(c->back + a->back, here, gains, 0);
        else if (a->store == CALLED || a->store == GIVEN) memset(gains + a->at, 0, a->size * sizeof(V));
        else copy(a, p, i, stores, gains, 1);
    }
  }
}

/* The rows of scenes, whose values and whose adjoints are walked apart; returns how many fit: the pairs of the next row are more than there is room for. */
API word roll(const crowd *c, const crowd *taped, const scenes *q, V *memory) {
  const word words = q->slopes && taped->words > c->words ? taped->words : c->words;
  word kinds = c->rooms - 1 - c->species, steps = q->steps, slots = 0;
  for (word r = 1 + c->species; r < c->rooms; r++) slots += c->list[r].members;
  scene s = {.c = c, .m = memory, .slots = slots};
  s.b = s.m + words;
  s.x = s.b + (q->slopes ? taped->words : 0);
  s.y = s.x + (steps + 1) * c->state;
  s.given = s.y + (q->slopes ? (steps + 1) * c->state : 0);
  s.pairs = (near *)(s.given + c->given);
  s.used = (int32_t *)(s.pairs + steps * slots);
  s.active = s.used + steps * kinds, s.count = s.active + slots;
  s.scratch = (char *)(((uintptr_t)(s.count + kinds) + 7) / 8 * 8);
  for (word row = 0; row < q->rows; row += LANES) {
    word rows = q->rows - row < LANES ? q->rows - row : LANES;
    memset(s.x, 0, (steps + 1) * c->state * sizeof(V));
    for (word l = 0; l < LANES; l++) {
      word from = row + (l < rows ? l : rows - 1);
      for (word w = 0; w < q->start_size; w++) LANE(s.x[w], l) = (R)q->start[from * q->start_size + w];
      for (word w = 0; w < c->given; w++) LANE(s.given[w], l) = (R)q->given[from * c->given + w];
    }
    s.c = c;
    for (word k = 0; k < steps; k++)
      if (!step(&s, k, q->most)) return row;
    for (word l = 0; l < rows; l++)
      for (word k = 0; k <= steps; k++)
        for (word w = 0; w < q->shown; w++)
          q->states[((row + l) * (steps + 1) + k) * q->shown + w] = (double)LANE(s.x[k * c->state + w], l);
    if (!q->slopes) continue;
    memset(s.y, 0, (steps + 1) * c->state * sizeof(V));
    memset(s.b, 0, taped->words * sizeof(V));
    s.c = taped;
    for (word l = 0; l < rows; l++)
      for (word k = 0; k <= steps; k++)
        for (word w = 0; w < q->shown; w++)
          LANE(s.y[k * c->state + w], l) = (R)q->slopes[((row + l) * (steps + 1) + k) * q->shown + w];
    for (word k = steps - 1; k >= 0; k--) {
      step(&s, k, 0);
      step_back(&s, k);
    }
    for (word l = 0; l < rows; l++)
      for (word w = 0; w < q->shown; w++)
        q->slopes[(row + l) * (steps + 1) * q->shown + w] = (double)LANE(s.y[w], l);
  }
  return q->rows;
}
