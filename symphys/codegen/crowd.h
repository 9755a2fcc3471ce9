/* What the driver of many bodies goes by. What the data mean is told in neighbours/plan.py. */
#include <stdlib.h>
#include <string.h>

#define CALL(t, m, b) FUNCTIONS[(t)[0]](m, b, (t) + 1, 0)

typedef int32_t place; /* of words in a memory, and of rows in a table: what a step goes through fits a cache */
typedef struct { word work, state, members, base, from; } room; /* words of a member; where members begin */
/* Of runs; actions in place of them, where the word of a section is 0; how runs are gone through, and where they stand by the
   words of their sieve. */
typedef struct { place room, first, end, others, others_end, section, way, turns; } loop;
typedef struct { place first, end, sieve, word, off; } run; /* of actions: done where a word is not 0, or where it is */
typedef struct { place store, of, offset, pitch, at, size, entry, back, several, first, end; } action; /* and its references */
typedef struct { place store, of, offset, pitch, argument; } reference; /* an argument of a call that lies elsewhere */
typedef struct { place room, places, size, loop; } sieve;   /* words by which members are told apart before a loop */
typedef struct { word first, second, plane; double normal[3], offset; } kind; /* species; -1: a plane */
typedef struct {
  word rooms, species, loops, words, state, given;
  word found, looked, striking; /* loops: before the first pairs are found, from the other on near ones are left; and where
                                   in the work of what is there once it says how far what strikes comes */
  const room *list;
  const loop *order;
  const run *runs;
  const place *turns;
  const action *actions;
  const reference *references;
  word length; /* of entries, where there are references */
  const place *entries, *back, *several; /* of calls, of their adjoints, of calls for several members */
  word sieves;
  const sieve *sifts;
  const place *words_of; /* of sieves: where they lie in the work of a member */
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

enum { WORK, BEFORE, AFTER, GIVEN, CALLED, CLEARED }; /* CLEARED: results of a call where it is left out */
enum { ONE_RUN, APART, IN_TURN, MIXED }; /* one run for all members; run by run; as a sieve lets them through; by member */
enum { OWN, FIRST, SECOND, ONCE, THEN, OUT = 8 };
/* before: the number of the same pair in the step before; -1: it was not near; -2: there is no pair in this lane */
typedef struct { int32_t first[LANES], second[LANES], before[LANES]; } near;

/* What a sieve has let through: pairs of a member and a word, in order; the same by word; words as bits, by member. */
typedef struct { int32_t *who, *which, *by_word, *counts, *bits, size, count; } sifted;

typedef struct {
  const crowd *c;
  V *m, *b, *x, *y, *given; /* work, its adjoints, states and their adjoints of all steps */
  near *pairs;              /* (steps, slots) */
  int32_t *used;            /* (steps, kinds) */
  int32_t *active, *count;  /* (slots) those that are near in the step, by kind; (kinds) how many */
  word slots;
  const word *before; /* (kinds) the number of the first pair of a kind among all */
  place *entries, *own_entries; /* those of the crowd, with the places of references */
  sifted *let; /* (sieves) */
  const int32_t *all; /* 0, 1, 2 .. */
  char *scratch;
} scene;
