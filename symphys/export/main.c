/* An example: takes z from its arguments, or the guess; prints the objective, the errors by name, and the gradient. */
#include <stdio.h>
#include <stdlib.h>

#include "$name.h"

static int read(double *z, int count, char **words) {
  for (int i = 0; i < ${NAME}_Z; i++) {
    char *end = 0;
    z[i] = count ? strtod(words[i], &end) : ${name}_guess[i];
    if (count && (end == words[i] || *end)) return 0;
  }
  return count == 0 || count == ${NAME}_Z;
}

static void print(const ${name}_result *result, const double *gradient) {
  printf("merit %.17g\nobjective %.17g\n", result->merit, result->objective);
#if ${NAME}_ERRORS
  for (int i = 0; i < ${NAME}_ERRORS; i++) printf("%s: %.17g\n", ${name}_error_names[i], result->errors[i]);
#endif
  for (int i = 0; i < ${NAME}_Z; i++) printf("gradient[%d] %.17g\n", i, gradient[i]);
}

int main(int count, char **words) {
  static double z[${NAME}_Z], gradient[${NAME}_Z];
  static ${name}_result result;
  if ((count != 1 && count != 1 + ${NAME}_Z) || !read(z, count - 1, words + 1)) {
    fprintf(stderr, "usage: %s [z], where z are %d numbers\n", words[0], ${NAME}_Z);
    return 2;
  }
  double *work = malloc(sizeof(double) * ${NAME}_WORK);
  if (!work) {
    fprintf(stderr, "%s: no memory\n", words[0]);
    return 1;
  }
  ${name}_gradient(z, 0, &result, gradient, work);
  print(&result, gradient);
  free(work);
  return 0;
}
