"""Multiple shooting: intervals, charts of the node states, the nonlinear program of both, and who solves it."""
