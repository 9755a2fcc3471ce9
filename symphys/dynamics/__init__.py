"""One time step, as a branch-free casadi expression."""
