/* A kernel as casadi's external functions. N, M and L are defined before: the lengths of z and of the constraints, and
   the lanes of their Jacobian. A function copies its arguments to where the kernel reads them, and its results back. */
#include <string.h>

#define API __attribute__((visibility("default")))
typedef long long int integer;
typedef struct {
  void (*evaluate)(const void *, const void *, void *);
  const void *program, *batch;
  void *memory;
  double *z, *parameters;
  const double *results[2];
} task;

static task tasks[3];

API void bind(const task *from) { memcpy(tasks, from, sizeof tasks); }

static int run(const task *t, const double **arg, double **res, integer first, integer second) {
  if (!t->evaluate) return 1;
  if (arg[0]) memcpy(t->z, arg[0], N * sizeof(double));
  else memset(t->z, 0, N * sizeof(double));
  *t->parameters = arg[1] ? *arg[1] : 0;
  t->evaluate(t->program, t->batch, t->memory);
  if (res[0]) memcpy(res[0], t->results[0], first * sizeof(double));
  if (res[1]) memcpy(res[1], t->results[1], second * sizeof(double));
  return 0;
}

/* Sizes are those of columns: a dense pattern in casadi's short form is rows, columns, 1. */
#define FUNCTION(name, task, rows, more, columns)                                                   \
  API int name(const double **arg, double **res, integer *iw, double *w, int mem) {                 \
    return run(&tasks[task], arg, res, rows, (integer)(more) * (columns));                          \
  }                                                                                                 \
  API integer name##_n_in(void) { return 2; }                                                       \
  API integer name##_n_out(void) { return 2; }                                                      \
  API const integer *name##_sparsity_in(integer i) {                                                \
    static const integer in[2][3] = {{N, 1, 1}, {1, 1, 1}};                                         \
    return in[i];                                                                                   \
  }                                                                                                 \
  API const integer *name##_sparsity_out(integer i) {                                               \
    static const integer out[2][3] = {{rows, 1, 1}, {more, columns, 1}};                            \
    return out[i];                                                                                  \
  }

FUNCTION(nlp, 0, 1, M, 1)
FUNCTION(nlp_gradient, 1, 1, N, 1)
FUNCTION(nlp_jacobian, 2, M, N, L)
