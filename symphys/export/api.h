/* $title

   Written by symphys $version from the problem $problem: plain C99, which needs nothing but the C library's math.
   SI units; z points up; world frame. $steps steps of $dt s.

   No function keeps anything: all that is computed on is the caller's, so that any number of threads may call them at
   once, each with its own work. Values are those of symphys, but for rounding.

   z, what may be chosen:
$decision
   x, the state:
$state
   u, forces and torques, constant over a step:
$inputs
   p, parameters:
$parameters
   t, by what states can differ, for linearize; turns are rotation vectors:
$tangent
   smoothing [m/s] >= 0 rounds off contact; 0 is the exact law.
   errors, each error / tolerance, met where <= 1:
$errors
   costs, with their weights:
$costs
   outputs:
$outputs
   constraints, their values:
$constraints
*/
#ifndef ${NAME}_H
#define ${NAME}_H

#define ${NAME}_Z $n /* numbers of z */
#define ${NAME}_X $nx /* of x */
#define ${NAME}_U $nu /* of u */
#define ${NAME}_P $np /* of p */
#define ${NAME}_T $nt /* of t */
#define ${NAME}_STEPS $steps
#define ${NAME}_ERRORS $count
#define ${NAME}_WORK $work /* numbers of work, for every function */

#ifdef __cplusplus
extern "C" {
#endif

extern const double ${name}_guess[${NAME}_Z], ${name}_lower[${NAME}_Z], ${name}_upper[${NAME}_Z];
extern const char *const ${name}_error_names[]; /* ${NAME}_ERRORS of them */

/* What came of a rollout. merit is the objective and the penalties of violated constraints; its gradient is computed.
   Without constraints both are one. merit = the sum of the squares of the residuals, if there are any. */
typedef struct {
$members
} ${name}_result;

/* The state at the start, (STEPS * U) inputs of every step, and parameters. u and p may be 0 if they have no numbers. */
void ${name}_start(const double *z, double *x, double *u, double *p, double *work);

/* The state after one time step; next may be x. */
void ${name}_step(const double *x, const double *u, const double *p, double smoothing, double *next, double *work);

/* The state after one time step with its controllers, and the step's exact slopes, row by row: a (T, T) the next t by t,
   b (T, $varied) by the first numbers of u, c (T, P) by p. u is $linearized. In ${name}_linearize.c. */
void ${name}_linearize(const double *x, const double *u, const double *p, double smoothing, double *next, double *a,
                       double *b, double *c, double *work);

/* All steps. states may be 0, or takes (STEPS + 1) * X numbers: the state at the start, and after each step. */
void ${name}_rollout(const double *z, double smoothing, ${name}_result *result, double *states, double *work);

/* All steps, and the Z derivatives of merit with respect to z. */
void ${name}_gradient(const double *z, double smoothing, ${name}_result *result, double *gradient, double *work);

#ifdef __cplusplus
}
#endif
#endif
