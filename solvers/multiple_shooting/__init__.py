"""Multiple shooting: intervals, charts of the node states, the nonlinear program, and its solvers."""
