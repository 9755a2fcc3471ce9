
/* What the header declares. The numbers of a result lie at the end of work. */
#define MEMORY $memory

const double ${name}_guess[] = {$guess};
const double ${name}_lower[] = {$lower};
const double ${name}_upper[] = {$upper};
const char *const ${name}_error_names[] = {$names};

static void copy(double *to, const double *from, word count) {
  for (word i = 0; i < count; i++) to[i] = from[i];
}

void ${name}_start(const double *z, double *x, double *u, double *p, double *work) {
  const double exact = 0;
  const batch one = {1, {z, 0}, {&exact, 0}, {0, 0}, 0, 0, 0, 0, 0, 0, 0};
  fill(&PROGRAM, &one, work, 0, 1);
  run(&PROGRAM.prologue, work, 0, 0);
  copy(x, work + $at_x, ${NAME}_X);
  copy(u, work + $at_u, ${NAME}_STEPS * ${NAME}_U);
  copy(p, work + $at_p, ${NAME}_P);
}

void ${name}_step(const double *x, const double *u, const double *p, double smoothing, double *next, double *work) {
  static const word places[] = {$places};
  copy(work, x, ${NAME}_X);
  copy(work + places[2], u, ${NAME}_U);
  copy(work + places[4], p, ${NAME}_P);
  work[places[6]] = smoothing;
  step(work, 0, places, 0);
  copy(next, work + places[8], ${NAME}_X);
}

void ${name}_rollout(const double *z, double smoothing, ${name}_result *result, double *states, double *work) {
  double *outputs = work + MEMORY;
  const batch one = {1, {z, 0}, {&smoothing, 0}, {0, 0}, outputs, 0, states, $at_x, ${NAME}_X, ${NAME}_X,
                     ${NAME}_STEPS + 1};
  evaluate(&PROGRAM, &one, work);
  memcpy(result, outputs, sizeof *result);
}

void ${name}_gradient(const double *z, double smoothing, ${name}_result *result, double *gradient, double *work) {
  double *outputs = work + MEMORY;
  const double seed = 1;
  const batch one = {1, {z, 0}, {&smoothing, 0}, {&seed, 0}, outputs, gradient, 0, 0, 0, 0, 0};
  evaluate(&PROGRAM, &one, work);
  memcpy(result, outputs, sizeof *result);
}
