"""The fixtures of a quick problem and a solver that does as it is told."""

from fakes.told import make_job, problem, problem_file, recorder, told_solver

__all__ = ["make_job", "problem", "problem_file", "recorder", "told_solver"]
