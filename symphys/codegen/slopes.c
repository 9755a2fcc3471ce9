/* Jacobians: values of LANES points at once, then blocks of LANES rows of each point by adjoints. */
#include <string.h>
#ifndef CALL
#define CALL(t, m, b, k) FUNCTIONS[(t)[0]](m, b, (t) + 2, k)
#endif

typedef struct { const char *taken; const word *rows; word left; const word *words; } block;
/* taken: a byte for each adjoint; rows: LANES numbers, -1 for none; words: (first, count) of what is to be zeroed, which
   is 0 where all is finite */
typedef struct {
  word size, tape, adjoints, height, width, result; /* result: where the adjoint of z begins */
  word z, z_size, parameters, parameters_size;
  const word *seeds;
  word length; /* of the entries of all calls */
  const word *entries;
  word pulls, items;  /* adjoints; at most so many things are done for one block of rows */
  const word *back, *calls, *copies, *uses, *cells; /* entries of adjoints; the others: see slopes/plan.py */
  word cell_count;
  word blocks;
  const block *rows;
  word kept, reads; /* words of one point that adjoints read, and where they come from: (first, count, two guards) */
  const word *read;
} slopes;
typedef struct { word points; const double *z, *parameters; word shared, columns; double *jacobian; } points;
typedef struct { word pull; const word *entry; word to, from, size; } item; /* without an entry: what is moved */

static int any(const V *m, word w) {
  if (w < 0) return 1;
  for (word l = 0; l < LANES; l++)
    if (LANE(m[w], l) != 0) return 1;
  return 0;
}

static void run(const word *t, const word *end, V *m) {
  while (t < end)
    if (t[0] >= 0) {
      CALL(t, m, (V *)0, 0);
      t += t[1];
    } else if (any(m, t[3])) t += t[1];
    else {
      for (const word *c = t + 4; c < t + t[1]; c += 4)
        for (word w = 0; w < c[3]; w++) m[c[0] + w] = m[c[1] + w];
      t += t[2];
    }
}

/* What is done for each block of rows of the point of a lane. ``at``: which place of each cell has its adjoint. */
static word listed(const slopes *p, const V *m, word l, item *items, char *at) {
  word count = 0;
  const word *call = p->calls;
  memset(at, 0, p->cell_count);
  for (word k = 0; k < p->pulls; k++, call += 6) {
    word way = 0;
    for (; way < 2; way++)
      if (call[1 + way] >= 0 && LANE(m[call[1 + way]], l) == 0) break;
    if (way < 2) {
      const word end = way ? call[6 + 3] : call[4];
      for (const word *c = p->copies + 4 * call[3 + way]; c < p->copies + 4 * end; c += 4)
        items[count++] = (item){k, 0, c[2], c[0] < 0 ? c[1] : p->cells[3 * c[0] + at[c[0]]], c[3]};
      continue;
    }
    for (const word *u = p->uses + 2 * call[5]; u < p->uses + 2 * call[6 + 5]; u += 2) {
      const word *cell = p->cells + 3 * u[0];
      if (at[u[0]] != u[1]) items[count++] = (item){k, 0, cell[u[1]], cell[1 - u[1]], cell[2]};
      at[u[0]] = (char)(1 - u[1]);
    }
    items[count++] = (item){k, p->back + call[0], 0, 0, 0};
  }
  return count;
}

static void pull(const item *items, word count, const char *taken, V *s, V *b) {
  for (const item *x = items; x < items + count; x++) {
    if (!taken[x->pull]) continue;
    if (x->entry) CALL(x->entry, s, b, 0);
    else
      for (word w = 0; w < x->size; w++) {
        if (x->to >= 0) b[x->to + w] += b[x->from + w];
        b[x->from + w] = S(0.0);
      }
  }
}

/* Lanes beyond the last point repeat it, so that they compute nothing unusual. */
static void gather(V *to, word size, const double *from, word stride, word first, word count) {
  for (word l = 0; l < LANES; l++) {
    const double *row = from + stride * (first + (l < count ? l : count - 1));
    for (word j = 0; j < size; j++) LANE(to[j], l) = (R)row[j];
  }
}

/* What adjoints read, point by point; without what calls have that are left out at all points. */
static void part(const slopes *p, const V *m, R *s) {
  const word *r = p->read;
  for (word i = 0, j = 0; i < p->reads; i++, j += r[1], r += 4) {
    if (!any(m, r[2]) || !any(m, r[3])) continue;
    for (word w = 0; w < r[1]; w++)
      for (word l = 0; l < LANES; l++) s[l * p->kept + j + w] = LANE(m[r[0] + w], l);
  }
}

/* Memory: size + tape vectors of values; kept numbers of each point; adjoints; what is listed of a point. */
API void jacobians(const slopes *p, const points *x, V *m) {
  R *values = (R *)(m + p->size + p->tape);
  V *b = m + p->size + p->tape + p->kept;
  item *items = (item *)(b + p->adjoints);
  char *at = (char *)(items + p->items);
  memset(m, 0, sizeof(V) * p->size);
  memset(b, 0, sizeof(V) * p->adjoints);
  for (word first = 0; first < x->points; first += LANES) {
    const word count = x->points - first < LANES ? x->points - first : LANES;
    gather(m + p->z, p->z_size, x->z, p->z_size, first, count);
    gather(m + p->parameters, p->parameters_size, x->parameters, x->shared ? 0 : p->parameters_size, first, count);
    run(p->entries, p->entries + p->length, m);
    part(p, m, values);
    for (word l = 0; l < count; l++) {
      V *s = (V *)(values + l * p->kept);
      const word items_of_point = listed(p, m, l, items, at);
      double *to = x->jacobian + (first + l) * p->height * x->columns;
      for (word i = 0; i < p->blocks; i++) {
        const block *rows = p->rows + i;
        for (word r = 0; r < LANES; r++)
          if (rows->rows[r] >= 0) LANE(b[p->seeds[rows->rows[r]]], r) = (R)1;
        pull(items, items_of_point, rows->taken, s, b);
        for (word j = 0; j < x->columns; j++) {
          const V found = b[p->result + j];
          for (word r = 0; r < LANES; r++)
            if (rows->rows[r] >= 0) to[rows->rows[r] * x->columns + j] = (double)LANE(found, r);
        }
        memset(b + p->result, 0, sizeof(V) * p->width);
        for (word r = 0; r < rows->left; r++) memset(b + rows->words[2 * r], 0, sizeof(V) * rows->words[2 * r + 1]);
      }
    }
  }
}
