/* Functions as codes, read one after the other: slower than compiled ones, with the same bits, and there at once.
   Codes of a function: its places, values that it keeps, address of the constants (two codes), for each place 0, 1 in the
   memory of adjoints, or 2 and the words that are read of it where one number is for all lanes; then operations, see
   emit/codes.py. An operand is a place and a word of it. */
#define AT(x) (at[(x) >> WORD_BITS] + ((x) & ((1u << WORD_BITS) - 1)))
#define NEXT goto *LABELS[*c]
#define CALL(t, m, b, k) interpret((const uint32_t *)(intptr_t)(t)[0], m, b, (t) + 2, k)

static NOINLINE void interpret(const uint32_t *c, V *m, V *b, const word *t, word k) {
  static const void *const LABELS[] = {OPERATIONS};
  const word places = c[0];
  V kept[c[1]], *free = kept, *at[places + 2];
  memcpy(at + 1, c + 2, sizeof(V *));
  c += 4;
  for (word i = 0; i < places; i++) {
    const word first = t[2 * i] + k * t[2 * i + 1];
    at[i + 2] = c[i] < 2 ? (c[i] ? b : m) + first : free;
    for (word w = 0; w + 2 < c[i]; w++) *free++ = ((const R *)m)[first + w] - (V){0};
  }
  at[0] = free;
  c += places;
  NEXT;
end:
  return;
copy:
  *AT(c[1]) = *AT(c[2]);
  c += 3;
  NEXT;
add_to:
  *AT(c[1]) += *AT(c[2]);
  c += 3;
  NEXT;
fill:
  for (uint32_t j = 0; j < c[3]; j++) AT(c[1])[j] = *AT(c[2]);
  c += 4;
  NEXT;
CASES
}
