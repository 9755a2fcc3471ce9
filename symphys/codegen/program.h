/* A program's data. A phase is entries: number of the function, length, then (offset, stride) of each place. */
#ifdef WARPS
typedef struct { word levels; const word *spans, *entries; } phase; /* spans: (first, end) by level and warp */
#else
typedef struct { word count; const word *entries; } phase;
#endif
typedef struct { word count; const word *places; } ranges; /* (offset, size) pairs */
typedef struct {
  word size, tape, steps;
  ranges z, parameters, zeroed, constants, outputs, seeded;
  const double *values;                                  /* of the constants */
  phase prologue, body, epilogue;                        /* forward */
  phase again, back_body, back_prologue, back_epilogue;  /* backward */
  word discounted[3], kept[2];                               /* (offset, size, stride), (offset, stride) */
  ranges written;                                        /* by each step: (offset, size, stride) */
  word first;                                            /* calls of the body up to the last guard */
  ranges guards, groups, calls, reads, writes, chains, sections, copies; /* see emit/guarding.py */
} program;
typedef struct { const double *rows; word stride; } source; /* stride 0: one row for all lanes */
