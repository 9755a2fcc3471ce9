/* Which pairs of many bodies may act in a step: reaches and what strikes are at least what the calls go by. */
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

enum { FEW = 32 }; /* bodies for which cells do not pay */
/* What a search goes by, and what it has found so far, by kind. */
typedef struct {
  const crowd *c;
  word bodies;
  double strikes;
  double (*seen)[4];       /* position and reach */
  int32_t *whose, *number; /* species of a body, and which of it */
  found *list;
  word *counts, *starts;
} hunt;

static inline void put(const hunt *h, word q, word first, word second, uint64_t key) {
  if (h->counts[q] < h->c->list[1 + h->c->species + q].members)
    h->list[h->starts[q] + h->counts[q]] = (found){key, h->number[first], h->number[second]};
  h->counts[q]++;
}

static void meet_planes(const hunt *h, word n) {
  word kinds = h->c->rooms - 1 - h->c->species;
  for (word q = 0; q < kinds; q++) {
    const kind *e = h->c->kinds + q;
    if (e->plane < 0 || e->first != h->whose[n]) continue;
    double height = -e->offset;
    for (word w = 0; w < 3; w++) height += e->normal[w] * h->seen[n][w];
    if (!(height > h->seen[n][3] + h->strikes)) put(h, q, n, n, n);
  }
}

static inline void meet(const hunt *h, word n, word o) {
  double square = 0, reach = h->seen[n][3] + h->seen[o][3] + h->strikes;
  for (word w = 0; w < 3; w++) square += (h->seen[n][w] - h->seen[o][w]) * (h->seen[n][w] - h->seen[o][w]);
  if (square > reach * reach * (1 + 1e-9)) return;
  word kinds = h->c->rooms - 1 - h->c->species;
  for (word q = 0; q < kinds; q++) {
    const kind *e = h->c->kinds + q;
    if (e->plane >= 0) continue;
    word i = -1, j = -1;
    if (e->first == h->whose[o] && e->second == h->whose[n]) i = o, j = n;
    else if (e->first == h->whose[n] && e->second == h->whose[o]) i = n, j = o;
    if (i < 0) continue;
    put(h, q, i, j, (uint64_t)((i + j) % h->bodies) * h->bodies + i);
    return;
  }
}

static uint64_t bucket_of(int64_t x, int64_t y, int64_t z, word buckets) {
  return ((uint64_t)x * 73856093u ^ (uint64_t)y * 19349663u ^ (uint64_t)z * 83492791u) & (buckets - 1);
}

/* Bodies meet those before them in the cells around their own, which are as wide as the farthest that two can act. */
static void meet_neighbours(const hunt *h, double width, int64_t (*cells)[3], int32_t *next, int32_t *heads, word buckets) {
  memset(heads, -1, buckets * sizeof(*heads));
  for (word n = 0; n < h->bodies; n++) {
    for (word w = 0; w < 3; w++) cells[n][w] = cell_of(h->seen[n][w], width);
    for (int beside = 0; beside < 27; beside++) {
      int64_t x = cells[n][0] + beside % 3 - 1, y = cells[n][1] + beside / 3 % 3 - 1, z = cells[n][2] + beside / 9 - 1;
      for (int32_t o = heads[bucket_of(x, y, z, buckets)]; o >= 0; o = next[o])
        if (cells[o][0] == x && cells[o][1] == y && cells[o][2] == z) meet(h, n, o);
    }
    int32_t *head = heads + bucket_of(cells[n][0], cells[n][1], cells[n][2], buckets);
    next[n] = *head, *head = n;
  }
}

static int search(const scene *s, word k, word l, word *most) {
  const crowd *c = s->c;
  word kinds = c->rooms - 1 - c->species, bodies = 0;
  for (word q = 0; q < c->species; q++) bodies += c->list[1 + q].members;
  double (*seen)[4] = (double (*)[4])s->scratch;
  int64_t (*cells)[3] = (int64_t (*)[3])(seen + bodies);
  int32_t *whose = (int32_t *)(cells + bodies), *number = whose + bodies, *next = number + bodies, *heads = next + bodies;
  word buckets = 1, counts[kinds + 1], starts[kinds + 1];
  while (buckets < 2 * bodies) buckets *= 2;
  found *list = (found *)(((uintptr_t)(heads + buckets) + 7) / 8 * 8);
  double strikes = LANE(s->m[c->list[0].base + c->striking], l), width = 0;
  for (word q = 0, n = 0; q < c->species; q++)
    for (word i = 0; i < c->list[1 + q].members; i++, n++) {
      for (word w = 0; w < 4; w++) seen[n][w] = at(s, i, q, w, l);
      whose[n] = q, number[n] = i;
      if (seen[n][3] > width) width = seen[n][3];
    }
  for (word q = 0; q < kinds; q++) counts[q] = 0, starts[q] = s->before[q];
  hunt h = {c, bodies, strikes, seen, whose, number, list, counts, starts};
  for (word n = 0; n < bodies; n++) {
    meet_planes(&h, n);
    for (word o = 0; bodies <= FEW && o < n; o++) meet(&h, n, o);
  }
  if (bodies > FEW) meet_neighbours(&h, 2 * width + strikes, cells, next, heads, buckets);
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
