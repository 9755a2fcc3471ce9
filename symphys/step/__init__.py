"""One time step, as a branch-free casadi expression."""

from symphys.step.function import report_function, step_function

__all__ = ["report_function", "step_function"]
