/* A run of steps of the Riccati recursion, the last step first; see runtime/riccati.py for the sizes.

   All matrices are row by row. A step leads from (state, decisions) to the next state by `through`. */

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("O3")
#endif
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef long long W;

enum { MAX_ITERATIONS = 100 };
static const double ARMIJO = 0.1, SHRINK = 0.6, LEAST = 1e-10, TOLERANCE = 1e-10;

/* Factor a symmetric matrix (n, n) of rows `stride` apart as L L', in its lower half; 0 if it is not positive definite. */
static int cholesky(double *a, W n, W stride) {
  for (W i = 0; i < n; i++) {
    double *row = a + i * stride;
    for (W j = 0; j <= i; j++) {
      const double *other = a + j * stride;
      double sum = row[j];
      for (W k = 0; k < j; k++) sum -= row[k] * other[k];
      if (i == j) {
        if (!(sum > 0)) return 0;
        row[i] = sqrt(sum);
      } else {
        row[j] = sum / other[j];
      }
    }
  }
  return 1;
}

/* Solve L L' x = b for each of the columns of b (n, columns), in place. */
static void solve(const double *l, W n, W stride, double *b, W columns) {
  for (W i = 0; i < n; i++) {
    for (W k = 0; k < i; k++)
      for (W j = 0; j < columns; j++) b[i * columns + j] -= l[i * stride + k] * b[k * columns + j];
    for (W j = 0; j < columns; j++) b[i * columns + j] /= l[i * stride + i];
  }
  for (W i = n - 1; i >= 0; i--) {
    for (W k = i + 1; k < n; k++)
      for (W j = 0; j < columns; j++) b[i * columns + j] -= l[k * stride + i] * b[k * columns + j];
    for (W j = 0; j < columns; j++) b[i * columns + j] /= l[i * stride + i];
  }
}

static double clip(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static double quadratic(const double *h, const double *g, const double *x, W n) {
  double sum = 0;
  for (W i = 0; i < n; i++) {
    double row = 0;
    for (W j = 0; j < n; j++) row += h[i * n + j] * x[j];
    sum += x[i] * (row / 2 + g[i]);
  }
  return sum;
}

/* Minimise x h x / 2 + g x within bounds, from x = 0, by projected Newton steps (see solvers/ddp/box_qp.py).

   Gives x (n,), the places of the free entries (their number is the result, -1 for a block that is not positive
   definite), and the factor of their block. `work` has room for 4 n numbers. */
static W bounded(const double *h, const double *g, const double *low, const double *high, W n, double *x, W *free_at,
                 double *factor, double *work) {
  double *slope = work, *ahead = work + n, *trial = work + 2 * n, size = 0;
  W count = -1;
  for (W i = 0; i < n; i++) {
    x[i] = clip(0, low[i], high[i]);
    size = fmax(size, fabs(g[i]));
  }
  for (int k = 0; k < MAX_ITERATIONS; k++) {
    W now = 0, same = count >= 0;
    for (W i = 0; i < n; i++) {
      slope[i] = g[i];
      for (W j = 0; j < n; j++) slope[i] += h[i * n + j] * x[j];
    }
    for (W i = 0; i < n; i++) {
      if ((x[i] <= low[i] && slope[i] > 0) || (x[i] >= high[i] && slope[i] < 0)) continue;
      same = same && now < count && free_at[now] == i;
      free_at[now++] = i;
    }
    if (!same || now != count) {
      count = now;
      if (!count) return 0;
      for (W i = 0; i < count; i++)
        for (W j = 0; j < count; j++) factor[i * n + j] = h[free_at[i] * n + free_at[j]];
      if (!cholesky(factor, count, n)) return -1;
    }
    double largest = 0;
    for (W i = 0; i < count; i++) largest = fmax(largest, fabs(slope[free_at[i]]));
    if (largest <= TOLERANCE * (1 + size)) break;
    for (W i = 0; i < count; i++) ahead[i] = -slope[free_at[i]];
    solve(factor, count, n, ahead, 1);
    double value = quadratic(h, g, x, n), share = 1;
    int found = 0;
    for (; share > LEAST && !found; share *= SHRINK) {
      double expected = 0;
      int moved = 0;
      memcpy(trial, x, (size_t)n * sizeof(double));
      for (W i = 0; i < count; i++) {
        W at = free_at[i];
        trial[at] = clip(x[at] + share * ahead[i], low[at], high[at]);
        expected -= slope[at] * (trial[at] - x[at]);
        moved = moved || trial[at] != x[at];
      }
      found = moved && value - quadratic(h, g, trial, n) >= ARMIJO * expected;
    }
    if (!found) break;
    memcpy(x, trial, (size_t)n * sizeof(double));
  }
  return count;
}

/* Returns 1, or 0 where a Hessian is not positive definite or there is no memory. */
__attribute__((visibility("default"))) int riccati(W steps, W next, W n, W w, const double *through, const double *own_slope, const double *own_curve,
            const double *lower, const double *upper, const double *damping, const double *last_slope,
            const double *last_curve, double *ahead, double *back, double *expected, double *slope, double *curve) {
  const W c = n + w, most = next > n ? next : n;
  double *memory = malloc((size_t)(most * most + most + most * c + c * c + c + 2 * w * w + 6 * w + w * (n + 1)) * sizeof(double));
  W *free_at = malloc((size_t)(w + 1) * sizeof(W));
  int done = memory && free_at;
  double *s = memory, *v = s + most * most, *p = v + most, *q = p + most * c, *t = q + c * c, *h = t + c;
  double *factor = h + w * w, *both = factor + w * w, *work = both + w * (n + 1), *along = work + 4 * w;
  W r = next;
  if (done) {
    memcpy(s, last_curve, (size_t)(r * r) * sizeof(double));
    memcpy(v, last_slope, (size_t)r * sizeof(double));
  }
  for (W k = steps - 1; done && k >= 0; k--) {
    const double *f = through + k * r * c, *low = lower + k * w, *high = upper + k * w, *damp = damping + k * w;
    double *u = ahead + k * w, *gain = back + k * w * n;
    /* Q = cost of the step + cost to go of the next state: slope t and curvature q by (state, decisions). */
    memcpy(t, own_slope + k * c, (size_t)c * sizeof(double));
    memcpy(q, own_curve + k * c * c, (size_t)(c * c) * sizeof(double));
    memset(p, 0, (size_t)(r * c) * sizeof(double));
    for (W i = 0; i < r; i++) {
      for (W j = 0; j < c; j++) t[j] += v[i] * f[i * c + j];
      for (W l = 0; l < r; l++)
        for (W j = 0; j < c; j++) p[i * c + j] += s[i * r + l] * f[l * c + j];
    }
    for (W l = 0; l < r; l++)
      for (W i = 0; i < c; i++)
        for (W j = 0; j < c; j++) q[i * c + j] += f[l * c + i] * p[l * c + j];
    /* Minimise Q over the decisions within bounds; feedback of those at no bound. */
    const double *g = t + n;
    for (W i = 0; i < w; i++) {
      for (W j = 0; j < w; j++) h[i * w + j] = factor[i * w + j] = q[(n + i) * c + n + j] + (i == j ? damp[i] : 0);
      both[i * (n + 1)] = g[i];
      memcpy(both + i * (n + 1) + 1, q + (n + i) * c, (size_t)n * sizeof(double));
    }
    if (!cholesky(factor, w, w)) {
      done = 0;
      break;
    }
    solve(factor, w, w, both, n + 1);
    int inside = 1;
    for (W i = 0; i < w; i++) {
      u[i] = -both[i * (n + 1)];
      inside = inside && u[i] >= low[i] && u[i] <= high[i];
      for (W j = 0; j < n; j++) gain[i * n + j] = -both[i * (n + 1) + 1 + j];
    }
    if (!inside) {
      W count = bounded(h, g, low, high, w, u, free_at, factor, work);
      if (count < 0) {
        done = 0;
        break;
      }
      for (W i = 0; i < count; i++) memcpy(both + i * n, q + (n + free_at[i]) * c, (size_t)n * sizeof(double));
      solve(factor, count, w, both, n);
      memset(gain, 0, (size_t)(w * n) * sizeof(double));
      for (W i = 0; i < count; i++)
        for (W j = 0; j < n; j++) gain[free_at[i] * n + j] = -both[i * n + j];
    }
    /* The change expected of a step length a, a first + a^2 second; then the cost to go of the state. */
    for (W i = 0; i < w; i++) {
      along[i] = 0;
      for (W j = 0; j < w; j++) along[i] += q[(n + i) * c + n + j] * u[j];
      expected[0] += g[i] * u[i];
      expected[1] += u[i] * along[i] / 2;
    }
    for (W j = 0; j < n; j++) {
      v[j] = t[j];
      for (W i = 0; i < w; i++) v[j] += (along[i] + g[i]) * gain[i * n + j] + u[i] * q[(n + i) * c + j];
    }
    for (W i = 0; i < n; i++) memcpy(p + i * n, q + i * c, (size_t)n * sizeof(double));
    for (W l = 0; l < w; l++)
      for (W i = 0; i < n; i++) {
        double left = q[(n + l) * c + i] - damp[l] * gain[l * n + i];
        for (W j = 0; j < n; j++) p[i * n + j] += left * gain[l * n + j];
      }
    for (W i = 0; i < n; i++)
      for (W j = 0; j < n; j++) s[i * n + j] = 0.5 * (p[i * n + j] + p[j * n + i]);
    r = n;
  }
  if (done) {
    memcpy(slope, v, (size_t)n * sizeof(double));
    memcpy(curve, s, (size_t)(n * n) * sizeof(double));
  }
  free(memory);
  free(free_at);
  return done;
}

/* The costates after steps, (steps, n), the last step first: costate = slope + costate a. Matrices a (n, n) lie `step`
   numbers apart, their rows `row`. */
__attribute__((visibility("default"))) void costates(W steps, W n, W step, W row, const double *a, const double *slopes,
            const double *last, double *after, double *first) {
  memcpy(after + (steps - 1) * n, last, (size_t)n * sizeof(double));
  for (W k = steps - 1; k >= 0; k--) {
    const double *v = after + k * n;
    double *to = k ? after + (k - 1) * n : first;
    memcpy(to, slopes + k * n, (size_t)n * sizeof(double));
    for (W i = 0; i < n; i++)
      for (W j = 0; j < n; j++) to[j] += v[i] * a[k * step + i * row + j];
  }
}
