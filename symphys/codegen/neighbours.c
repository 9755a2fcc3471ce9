/* Steps of many bodies: loops over bodies and over the pairs that are near, which each step finds anew. The lanes of a block
   are scenes, each with pairs of its own. */
/* A vector of a word of each lane, put together before it is stored: a processor waits long for a wide load of what was
   stored in parts just before. And the other way, where compilers' scatters are slow. */
static inline V gathered(R *const *other, word w) {
  V x = S(0.0);
  for (word l = 0; l < LANES; l++) LANE(x, l) = other[l][w * LANES];
  return x;
}

static inline void scatter(R *const *other, word w, V x) {
  for (word l = 0; l < LANES; l++) *(volatile R *)(other[l] + w * LANES) = LANE(x, l);
}

/* A copy in which each lane has members of its own; lanes without a pair have no effect. */
static NOINLINE void copy_lanes(const action *a, const near *p, V *there, V *own, int gains) {
  word out = a->of & OUT, of = a->of & ~OUT, missing = 0;
  R spare[a->size * LANES], *other[LANES];
  for (word l = 0; l < LANES; l++) {
    word k = of == FIRST ? p->first[l] : of == SECOND ? p->second[l] : of == THEN ? p->before[l] : 0;
    int is = k >= 0 && !(out && p->before[l] == -2);
    other[l] = is ? (R *)(there + k * a->pitch) + l : spare;
    missing |= !is;
  }
  if (missing) memset(spare, 0, sizeof(spare));
  if (out && gains)
    for (word w = 0; w < a->size; w++) own[w] += gathered(other, w), scatter(other, w, S(0.0));
  else if (gains)
    for (word w = 0; w < a->size; w++) scatter(other, w, gathered(other, w) + own[w]), own[w] = S(0.0);
  else if (out)
    for (word w = 0; w < a->size; w++) scatter(other, w, own[w]);
  else
    for (word w = 0; w < a->size; w++) own[w] = gathered(other, w);
}

/* Word by word: a processor waits long for a wide load of what was stored in parts just before. */
static inline void move(V *to, const V *from, word size) {
  for (word w = 0; w < size; w++) ((volatile V *)to)[w] = ((const volatile V *)from)[w];
}

static inline __attribute__((always_inline)) void copy(
    const action *a, const near *p, word i, V *const *stores, V *here, int gains) {
  V *there = stores[a->store] + a->offset, *own = here + a->at;
  word out = a->of & OUT, of = a->of & ~OUT;
#if LANES > 1
  if (of == FIRST || of == SECOND || of == THEN || (out && of == ONCE && p)) {
    copy_lanes(a, p, there, own, gains);
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
  if (!gains && out) move(there, own, a->size);
  else if (!gains) move(own, there, a->size);
  for (word w = 0; gains && w < a->size; w++)
    if (out) own[w] += there[w], there[w] = S(0.0);
    else there[w] += own[w], own[w] = S(0.0);
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
    word room = 1 + c->species + q, first = s->before[q], n = 0;
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

/* The members that loops go through, by room: the pairs that were found, then those that are near. */
typedef struct { word count; const int32_t *listed; const near *pairs; } round;

static void rounds_of(const scene *s, word k, int listed, round *rounds) {
  const crowd *c = s->c;
  word kinds = c->rooms - 1 - c->species;
  for (word r = 0; r <= c->species; r++) rounds[r] = (round){c->list[r].members, 0, 0};
  for (word q = 0; q < kinds; q++)
    rounds[1 + c->species + q] = (round){
        listed ? s->count[q] : s->used[k * kinds + q], listed ? s->active + s->before[q] : 0,
        s->pairs + k * s->slots + s->before[q]};
}

static void sift(const scene *s, word q, const round *rounds) {
  const sieve *v = s->c->sifts + q;
  sifted *f = s->let + q;
  const round r = rounds[v->room];
  const room *own = s->c->list + v->room;
  f->count = 0;
  memset(f->counts, 0, v->size * sizeof(*f->counts));
  for (word j = 0; j < r.count; j++) {
    word i = r.listed ? r.listed[j] : j;
    const V *here = s->m + own->base + i * own->work;
    int32_t bits = 0;
    for (word w = 0; w < v->size; w++)
      if (any(here + s->c->words_of[v->places + w])) {
        bits |= (int32_t)1 << w;
        f->who[f->count] = i, f->which[f->count++] = w;
        f->by_word[w * f->size + f->counts[w]++] = i;
      }
    f->bits[i] = bits;
  }
}

static int goes(const scene *s, const run *n, word i) {
  return n->sieve < 0 || (s->let[n->sieve].bits[i] >> n->word & 1) != n->off;
}

/* Where an argument of a member's call lies. */
static inline V *referred(const reference *r, const near *p, word i, V *const *stores) {
  word k = r->of == OWN ? i : r->of == ONCE ? 0 : r->of == FIRST ? p[i].first[0] : p[i].second[0];
  return stores[r->store] + r->offset + k * r->pitch;
}

/* One call for several members, in the lanes of a vector; the last one fills those that are left. */
#ifdef SEVERAL
static void call_several(
    const scene *s, const action *a, const room *own, const near *p, const int32_t *who, word count, V *const *stores) {
  const place *t = s->c->several + a->several;
  const reference *first = s->c->references + a->first, *end = s->c->references + a->end;
  word n = t[1];
  place places[SEVERAL * n];
  for (word j = 0; j < count; j += SEVERAL) {
    for (word l = 0; l < SEVERAL; l++) {
      word i = who[j + l < count ? j + l : count - 1], base = own->base + i * own->work;
      for (word w = 0; w < n; w++) places[w * SEVERAL + l] = (place)(t[2 + w] + base);
      for (const reference *r = first; r < end; r++)
        places[r->argument * SEVERAL + l] = (place)(referred(r, p, i, stores) - s->m);
    }
    FUNCTIONS[t[0]](s->m, 0, places, 0);
  }
}
#define FEWEST 3 /* members for which that pays */
#endif

/* Actions for one member. */
static inline __attribute__((always_inline)) void act(
    const scene *s, const room *own, const action *a, const action *end, const near *pairs, word i, V *const *stores) {
  V *here = s->m + own->base + i * own->work;
  const reference *references = s->c->references;
  for (; a < end; a++)
    if (a->store == CALLED) {
      place *t = s->entries + a->entry;
      for (const reference *r = references + a->first; r < references + a->end; r++)
        t[1 + r->argument] = (place)(referred(r, pairs, i, stores) - here);
      CALL(t, here, 0);
    } else if (a->store == CLEARED) memset(here + a->at, 0, a->size * sizeof(V));
    else copy(a, pairs ? pairs + i : 0, i, stores, here, 0);
}

static inline __attribute__((always_inline)) void act_back(
    const scene *s, const loop *o, const action *a, const round *r, word i, V *const *stores) {
  const room *own = s->c->list + o->room;
  V *here = s->m + own->base + i * own->work, *gains = s->b + own->base + i * own->work;
  if (a->store == CALLED && a->back >= 0) CALL(s->c->back + a->back, here, gains);
  else if (a->store == CALLED || a->store == GIVEN || a->store == CLEARED) memset(gains + a->at, 0, a->size * sizeof(V));
  else copy(a, r->pairs ? r->pairs + i : 0, i, stores, gains, 1);
}

/* The members for which a run is done. */
static word members_of(const scene *s, const run *n, const round *r, const int32_t **who, int32_t *room_for) {
  if (n->sieve < 0) {
    *who = r->listed ? r->listed : s->all;
    return r->count;
  }
  const sifted *f = s->let + n->sieve;
  *who = f->by_word + n->word * f->size;
  if (!n->off) return f->counts[n->word];
  word count = 0;
  for (word j = 0; j < r->count; j++) {
    word i = r->listed ? r->listed[j] : j;
    if (goes(s, n, i)) room_for[count++] = i;
  }
  *who = room_for;
  return count;
}

/* Run by run, each for all of its members. */
static NOINLINE void go_apart(const scene *s, const loop *o, const round *r, V *const *stores) {
  const crowd *c = s->c;
  const room *own = c->list + o->room;
  int32_t room_for[r->count];
  for (const run *n = c->runs + o->first; n < c->runs + o->end; n++) {
    const int32_t *who;
    word count = members_of(s, n, r, &who, room_for);
    for (const action *a = c->actions + n->first, *end; a < c->actions + n->end; a = end) {
      end = a + 1;
#ifdef SEVERAL
      if (a->several >= 0 && count >= FEWEST) {
        call_several(s, a, own, r->pairs, who, count, stores);
        continue;
      }
      while (end < c->actions + n->end && (end->several < 0 || count < FEWEST)) end++;
#else
      end = c->actions + n->end;
#endif
      for (word j = 0; j < count; j++) act(s, own, a, end, r->pairs, who[j], stores);
    }
  }
}

/* What a sieve has let through, one after the other. */
static NOINLINE void go_in_turn(const scene *s, const loop *o, const round *r, V *const *stores) {
  const crowd *c = s->c;
  const sifted *f = s->let + c->runs[o->first].sieve;
  for (word k = 0; k < f->count; k++) {
    word turn = c->turns[o->turns + f->which[k]];
    if (turn < 0) continue;
    const run *n = c->runs + turn;
    act(s, c->list + o->room, c->actions + n->first, c->actions + n->end, r->pairs, f->who[k], stores);
  }
}

static NOINLINE void go_mixed(const scene *s, const loop *o, const round *r, V *const *stores) {
  const crowd *c = s->c;
  for (word j = 0; j < r->count; j++) {
    word i = r->listed ? r->listed[j] : j;
    for (const run *n = c->runs + o->first; n < c->runs + o->end; n++)
      if (goes(s, n, i))
        act(s, c->list + o->room, c->actions + n->first, c->actions + n->end, r->pairs, i, stores);
  }
}

static inline void go(const scene *s, const loop *o, const round *r, V *const *stores) {
  const crowd *c = s->c;
  int left_out = o->section >= 0 && !any(s->m + c->list[0].base + o->section);
  if (!left_out && o->way == APART) go_apart(s, o, r, stores);
  else if (!left_out && o->way == IN_TURN) go_in_turn(s, o, r, stores);
  else if (!left_out && o->way == MIXED) go_mixed(s, o, r, stores);
  else {
    const action *first = c->actions + (left_out ? o->others : c->runs[o->first].first);
    const action *end = c->actions + (left_out ? o->others_end : c->runs[o->first].end);
    for (word j = 0; j < r->count; j++)
      act(s, c->list + o->room, first, end, r->pairs, r->listed ? r->listed[j] : j, stores);
  }
}

static void go_back(const scene *s, const loop *o, const round *r, V *const *stores) {
  const crowd *c = s->c;
  int left_out = o->section >= 0 && !any(s->m + c->list[0].base + o->section);
  for (word j = r->count - 1; j >= 0; j--) {
    word i = r->listed ? r->listed[j] : j;
    if (left_out) {
      for (const action *a = c->actions + o->others_end - 1; a >= c->actions + o->others; a--)
        act_back(s, o, a, r, i, stores);
      continue;
    }
    for (const run *n = c->runs + o->end - 1; n >= c->runs + o->first; n--)
      if (goes(s, n, i))
        for (const action *a = c->actions + n->end - 1; a >= c->actions + n->first; a--) act_back(s, o, a, r, i, stores);
  }
}

static int step(const scene *s, word k, word *most) {
  const crowd *c = s->c;
  word kinds = c->rooms - 1 - c->species, sieves = 0;
  V *stores[] = {s->m, s->x + k * c->state, s->x + (k + 1) * c->state, s->given};
  round rounds[c->rooms];
  rounds_of(s, k, 0, rounds);
  for (word n = 0; n < c->loops; n++) {
    if (n == c->found && most) {
      memset(s->used + k * kinds, 0, kinds * sizeof(*s->used));
      for (word l = 0; l < LANES; l++)
        if (!search(s, k, l, most)) return 0;
      rounds_of(s, k, 0, rounds);
    }
    if (n == c->looked) list_near(s, k), rounds_of(s, k, 1, rounds);
    for (; sieves < c->sieves && c->sifts[sieves].loop == n; sieves++) sift(s, sieves, rounds);
    const loop *o = c->order + n;
    if (rounds[o->room].count) go(s, o, rounds + o->room, stores);
  }
  return 1;
}

static void step_back(const scene *s, word k) {
  const crowd *c = s->c;
  V *stores[] = {s->b, s->y + k * c->state, s->y + (k + 1) * c->state, 0};
  round rounds[c->rooms];
  rounds_of(s, k, 1, rounds);
  for (word n = c->loops - 1; n >= 0; n--) {
    if (n == c->looked - 1) rounds_of(s, k, 0, rounds);
    const loop *o = c->order + n;
    if (rounds[o->room].count) go_back(s, o, rounds + o->room, stores);
  }
}

/* Room for what sieves let through, and the numbers of members. */
static void make_room(scene *s) {
  const crowd *c = s->c;
  s->own_entries = (place *)s->scratch;
  int32_t *at = (int32_t *)(s->own_entries + c->length), *all = at;
  word most = 0;
  for (word r = 0; r < c->rooms; r++) most = c->list[r].members > most ? c->list[r].members : most;
  for (word i = 0; i < most; i++) all[i] = i;
  s->all = all, at += most;
  for (word q = 0; q < c->sieves; q++) {
    word words = c->sifts[q].size, size = c->list[c->sifts[q].room].members;
    int32_t *who = at, *which = who + words * size, *by_word = which + words * size, *counts = by_word + words * size;
    s->let[q] = (sifted){who, which, by_word, counts, counts + words, size, 0};
    at = counts + words + size;
  }
  s->scratch = (char *)(((uintptr_t)at + 7) / 8 * 8);
}

static void enter(scene *s, const crowd *c) {
  s->c = c;
  s->entries = c->length ? memcpy(s->own_entries, c->entries, c->length * sizeof(place)) : (place *)c->entries;
}

/* The rows of scenes, whose values and whose adjoints are walked apart; returns how many fit: the pairs of the next row are
   more than there is room for. */
API word roll(const crowd *c, const crowd *taped, const scenes *q, V *memory) {
  const word words = q->slopes && taped->words > c->words ? taped->words : c->words;
  word kinds = c->rooms - 1 - c->species, steps = q->steps, slots = 0, before[kinds + 1];
  for (word r = 0; r < kinds; r++) before[r] = slots, slots += c->list[1 + c->species + r].members;
  scene s = {.c = c, .m = memory, .slots = slots, .before = before};
  s.b = s.m + words;
  s.x = s.b + (q->slopes ? taped->words : 0);
  s.y = s.x + (steps + 1) * c->state;
  s.given = s.y + (q->slopes ? (steps + 1) * c->state : 0);
  s.pairs = (near *)(s.given + c->given);
  s.used = (int32_t *)(s.pairs + steps * slots);
  s.active = s.used + steps * kinds, s.count = s.active + slots;
  s.scratch = (char *)(((uintptr_t)(s.count + kinds) + 7) / 8 * 8);
  sifted let[c->sieves + 1];
  s.let = let;
  make_room(&s);
  for (word row = 0; row < q->rows; row += LANES) {
    word rows = q->rows - row < LANES ? q->rows - row : LANES;
    memset(s.x, 0, (steps + 1) * c->state * sizeof(V));
    for (word l = 0; l < LANES; l++) {
      word from = row + (l < rows ? l : rows - 1);
      for (word w = 0; w < q->start_size; w++) LANE(s.x[w], l) = (R)q->start[from * q->start_size + w];
      for (word w = 0; w < c->given; w++) LANE(s.given[w], l) = (R)q->given[from * c->given + w];
    }
    enter(&s, c);
    for (word k = 0; k < steps; k++)
      if (!step(&s, k, q->most)) return row;
    for (word l = 0; l < rows; l++)
      for (word k = 0; k <= steps; k++)
        for (word w = 0; w < q->shown; w++)
          q->states[((row + l) * (steps + 1) + k) * q->shown + w] = (double)LANE(s.x[k * c->state + w], l);
    if (!q->slopes) continue;
    memset(s.y, 0, (steps + 1) * c->state * sizeof(V));
    memset(s.b, 0, taped->words * sizeof(V));
    enter(&s, taped);
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
