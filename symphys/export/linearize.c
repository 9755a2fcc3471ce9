
static void copy(double *to, const double *from, word count) {
  for (word i = 0; i < count; i++) to[i] = from[i];
}

void ${name}_linearize(const double *x, const double *u, const double *p, double smoothing, double *next, double *a,
                       double *b, double *c, double *work) {
  static const word places[] = {$slope_places};
  const word count = ${NAME}_T + $varied + ${NAME}_P;
  copy(work, x, ${NAME}_X);
  copy(work + places[2], u, $given);
  copy(work + places[4], p, ${NAME}_P);
  work[places[6]] = smoothing;
  for (word i = 0; i < count; i++) work[places[8] + i] = 0; /* dx, du and dp follow each other */
  for (word i = 0; i < count; i++) {
    const word j = i < ${NAME}_T ? i : i < ${NAME}_T + $varied ? i - ${NAME}_T : i - ${NAME}_T - $varied;
    const word columns = i < ${NAME}_T ? ${NAME}_T : i < ${NAME}_T + $varied ? $varied : ${NAME}_P;
    double *slopes = i < ${NAME}_T ? a : i < ${NAME}_T + $varied ? b : c;
    work[places[8] + i] = 1;
    slope(work, 0, places, 0);
    work[places[8] + i] = 0;
    for (word row = 0; row < ${NAME}_T; row++) slopes[row * columns + j] = work[places[16] + row];
  }
  copy(next, work + places[14], ${NAME}_X);
}
