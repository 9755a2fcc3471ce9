/* One phase or step alone, to look for the call that went wrong. */
API void begin(const program *p, const batch *x, V *m) { fill(p, x, m, 0, 1); }

API void perform(const phase *calls, V *m, word k) { run(calls, m, 0, k); }
