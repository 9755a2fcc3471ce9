"""Joint constraints: locked directions, limits, motors and springs, and what is kept of them for a warm start."""
