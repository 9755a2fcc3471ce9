/* Steps of many bodies: loops over bodies and over the pairs that are near, which each step finds anew. What the data
   mean is told in neighbours/plan.py. The lanes of a block are scenes, each with pairs of its own. */
#include <stdlib.h>
#include <string.h>

#define CALL(t, m, b, k) FUNCTIONS[(t)[0]](m, b, (t) + 2, k)

typedef struct { word work, state, members, base, from; } room; /* words of a member; where members begin */
typedef struct { word room, first, end; } loop;                 /* of its actions */
typedef struct { word store, room, of, offset, at, size, entry, back; } action; /* store -1: a call, else a copy */
typedef struct { word first, second, plane; double normal[3], offset; } kind; /* species; -1: a plane */
typedef struct {
  word rooms, species, loops, words, state, given, found;
  const room *list;
  const loop *order;
  const action *actions;
  const word *values, *again, *back; /* entries of calls */
  const kind *kinds;
  const word *sight; /* room by room where a position and a reach lie, and how far what strikes comes */
  word striking;
} crowd;
typedef struct {
  word rows, steps;
  const double *start, *given; /* (rows, start), (rows, given) */
  double *states, *slopes;     /* (rows, steps + 1, shown); slopes: what they are weighed with, then that of the start */
  word shown, start_size;
  word *most;                  /* (kinds): pairs at most */
} scenes;

enum { WORK, BEFORE, AFTER, GIVEN };
enum { OWN, FIRST, SECOND, ONCE };
typedef struct { int32_t first[LANES], second[LANES], before[LANES]; } near; /* before -1: not near then; -2: no pair */

typedef struct {
  const crowd *c;
  V *m, *b, *x, *y, *given; /* work, its adjoints, states and their adjoints of all steps */
  near *pairs;              /* (steps, slots) */
  int32_t *used;            /* (steps, kinds) */
  word slots;
  char *scratch;
} scene;

static word members(const scene *s, word room, word k) {
  const crowd *c = s->c;
  return room <= c->species ? c->list[room].members : s->used[k * (c->rooms - 1 - c->species) + room - 1 - c->species];
}

static word slot_of(const scene *s, word room, word i) {
  word slot = i;
  for (word r = 1 + s->c->species; r < room; r++) slot += s->c->list[r].members;
  return slot;
}

static const near *pair_of(const scene *s, word room, word i, word k) {
  return room <= s->c->species ? 0 : s->pairs + k * s->slots + slot_of(s, room, i);
}

/* One copy. ``there`` begins the other store's room, ``pitch`` apart are its members. */
static void copied(const action *a, const near *p, word i, V *there, word pitch, V *here, int gains) {
  word out = a->of & 8, of = a->of & 7;
  there += a->offset, here += a->at;
  if (!p || (of == OWN && (out || a->store != BEFORE)) || (of == ONCE && !out)) {
    there += of == ONCE ? 0 : i * pitch;
    for (word w = 0; w < a->size; w++)
      if (gains) {
        if (out) here[w] += there[w], there[w] = S(0.0);
        else there[w] += here[w], here[w] = S(0.0);
      } else if (out) there[w] = here[w];
      else here[w] = there[w];
    return;
  }
  for (word l = 0; l < LANES; l++) {
    word k = i, none = 0;
    if (of == ONCE) k = 0;
    if (p) {
      if (of == FIRST) k = p->first[l];
      if (of == SECOND) k = p->second[l];
      if (of == OWN && a->store == BEFORE) k = p->before[l], none = k < 0;
      none |= out && p->before[l] == -2;
    }
    V *other = there + (none ? 0 : k * pitch);
#define EACH for (word w = 0; w < a->size; w++)
    if (!gains && !out) EACH LANE(here[w], l) = none ? (R)0 : LANE(other[w], l);
    if (!gains && out && !none) EACH LANE(other[w], l) = LANE(here[w], l);
    if (gains && !out) EACH {
      if (!none) LANE(other[w], l) += LANE(here[w], l);
      LANE(here[w], l) = 0;
    }
    if (gains && out && !none) EACH LANE(here[w], l) += LANE(other[w], l), LANE(other[w], l) = 0;
  }
}

static void move(const scene *s, const action *a, const near *p, word i, word k, V *here, int gains) {
  const crowd *c = s->c;
  const room *r = c->list + a->room;
  V *base = gains ? s->b : s->m, *states = gains ? s->y : s->x;
  if (a->store == WORK) copied(a, p, i, base + r->base, r->work, here, gains);
  else if (a->store == GIVEN) {
    if (!gains) copied(a, p, 0, s->given, 0, here, 0);
    else memset(here + a->at, 0, a->size * sizeof(V));
  } else copied(a, p, i, states + (k + (a->store == AFTER)) * c->state + r->from, r->state, here, gains);
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

static int64_t cell_of(double x, double width) { return (int64_t)__builtin_floor(x / width); }

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

static int step(const scene *s, word k, const word *entries, word from, word end, word *most) {
  const crowd *c = s->c;
  word kinds = c->rooms - 1 - c->species;
  for (word n = from; n < end; n++) {
    if (n == c->found && most) {
      memset(s->used + k * kinds, 0, kinds * sizeof(*s->used));
      for (word l = 0; l < LANES; l++)
        if (!search(s, k, l, most)) return 0;
    }
    const loop *o = c->order + n;
    const room *r = c->list + o->room;
    word count = members(s, o->room, k);
    for (word i = 0; i < count; i++) {
      V *here = s->m + r->base + i * r->work;
      const near *p = pair_of(s, o->room, i, k);
      for (const action *a = c->actions + o->first; a < c->actions + o->end; a++)
        if (a->store < 0) CALL(entries + a->entry, here, 0, 0);
        else move(s, a, p, i, k, here, 0);
    }
  }
  return 1;
}

static void step_back(const scene *s, word k) {
  const crowd *c = s->c;
  for (word n = c->loops - 1; n >= 0; n--) {
    const loop *o = c->order + n;
    const room *r = c->list + o->room;
    for (word i = members(s, o->room, k) - 1; i >= 0; i--) {
      V *here = s->m + r->base + i * r->work, *gains = s->b + r->base + i * r->work;
      const near *p = pair_of(s, o->room, i, k);
      for (const action *a = c->actions + o->end - 1; a >= c->actions + o->first; a--)
        if (a->store >= 0) move(s, a, p, i, k, gains, 1);
        else if (a->back >= 0) CALL(c->back + a->back, here, gains, 0);
        else memset(gains + a->at, 0, a->size * sizeof(V));
    }
  }
}

/* The rows of scenes; returns how many fit: the pairs of the next row are more than there is room for. */
API word roll(const crowd *c, const scenes *q, V *memory) {
  word kinds = c->rooms - 1 - c->species, steps = q->steps, slots = 0;
  for (word r = 1 + c->species; r < c->rooms; r++) slots += c->list[r].members;
  scene s = {.c = c, .m = memory, .slots = slots};
  s.b = s.m + c->words;
  s.x = s.b + c->words;
  s.y = s.x + (steps + 1) * c->state;
  s.given = s.y + (q->slopes ? (steps + 1) * c->state : 0);
  s.pairs = (near *)(s.given + c->given);
  s.used = (int32_t *)(s.pairs + steps * slots);
  s.scratch = (char *)(((uintptr_t)(s.used + steps * kinds) + 7) / 8 * 8);
  for (word row = 0; row < q->rows; row += LANES) {
    word rows = q->rows - row < LANES ? q->rows - row : LANES;
    memset(s.x, 0, (steps + 1) * c->state * sizeof(V));
    for (word l = 0; l < LANES; l++) {
      word from = row + (l < rows ? l : rows - 1);
      for (word w = 0; w < q->start_size; w++) LANE(s.x[w], l) = (R)q->start[from * q->start_size + w];
      for (word w = 0; w < c->given; w++) LANE(s.given[w], l) = (R)q->given[from * c->given + w];
    }
    for (word k = 0; k < steps; k++)
      if (!step(&s, k, c->values, 0, c->loops, q->most)) return row;
    for (word l = 0; l < rows; l++)
      for (word k = 0; k <= steps; k++)
        for (word w = 0; w < q->shown; w++)
          q->states[((row + l) * (steps + 1) + k) * q->shown + w] = (double)LANE(s.x[k * c->state + w], l);
    if (!q->slopes) continue;
    memset(s.y, 0, (steps + 1) * c->state * sizeof(V));
    memset(s.b, 0, c->words * sizeof(V));
    for (word l = 0; l < rows; l++)
      for (word k = 0; k <= steps; k++)
        for (word w = 0; w < q->shown; w++)
          LANE(s.y[k * c->state + w], l) = (R)q->slopes[((row + l) * (steps + 1) + k) * q->shown + w];
    for (word k = steps - 1; k >= 0; k--) {
      step(&s, k, c->again, 0, c->loops, 0);
      step_back(&s, k);
    }
    for (word l = 0; l < rows; l++)
      for (word w = 0; w < q->shown; w++)
        q->slopes[(row + l) * (steps + 1) * q->shown + w] = (double)LANE(s.y[w], l);
  }
  return q->rows;
}
