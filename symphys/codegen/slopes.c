/* Jacobians: values of LANES points at once, then blocks of LANES rows of each point by adjoints. */
#include <string.h>

typedef struct { word count; const word *entries, *rows; word left; const word *words; } block;
/* rows: LANES numbers, -1 for none; words: (first, count) of what is to be zeroed, which is 0 where all is finite */
typedef struct {
  word size, tape, adjoints, height, width, result; /* result: where the adjoint of z begins */
  word z, z_size, parameters, parameters_size;
  const word *seeds;
  word calls;
  const word *entries;
  word blocks;
  const block *rows;
  word kept, reads; /* words of one point that adjoints read, and where they come from: (first, count) */
  const word *read;
} slopes;
typedef struct { word points; const double *z, *parameters; word shared, columns; double *jacobian; } points;

static void run(const word *t, word count, V *m, V *b) {
  for (word c = 0; c < count; c++, t += t[1]) FUNCTIONS[t[0]](m, b, t + 2, 0);
}

/* Lanes beyond the last point repeat it, so that they compute nothing unusual. */
static void gather(V *to, word size, const double *from, word stride, word first, word count) {
  for (word l = 0; l < LANES; l++) {
    const double *row = from + stride * (first + (l < count ? l : count - 1));
    for (word j = 0; j < size; j++) LANE(to[j], l) = (R)row[j];
  }
}

/* What adjoints read, point by point. */
static void part(const slopes *p, const V *m, R *s) {
  for (word i = 0, j = 0; i < p->reads; i++)
    for (word w = p->read[2 * i]; w < p->read[2 * i] + p->read[2 * i + 1]; w++, j++)
      for (word l = 0; l < LANES; l++) s[l * p->kept + j] = LANE(m[w], l);
}

/* Memory: size + tape vectors of values; kept numbers of each point; adjoints. */
API void jacobians(const slopes *p, const points *x, V *m) {
  R *values = (R *)(m + p->size + p->tape);
  V *b = m + p->size + p->tape + p->kept;
  memset(m, 0, sizeof(V) * p->size);
  memset(b, 0, sizeof(V) * p->adjoints);
  for (word first = 0; first < x->points; first += LANES) {
    const word count = x->points - first < LANES ? x->points - first : LANES;
    gather(m + p->z, p->z_size, x->z, p->z_size, first, count);
    gather(m + p->parameters, p->parameters_size, x->parameters, x->shared ? 0 : p->parameters_size, first, count);
    run(p->entries, p->calls, m, 0);
    part(p, m, values);
    for (word l = 0; l < count; l++) {
      V *s = (V *)(values + l * p->kept);
      double *to = x->jacobian + (first + l) * p->height * x->columns;
      for (word i = 0; i < p->blocks; i++) {
        const block *rows = p->rows + i;
        for (word r = 0; r < LANES; r++)
          if (rows->rows[r] >= 0) LANE(b[p->seeds[rows->rows[r]]], r) = (R)1;
        run(rows->entries, rows->count, s, b);
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
