"""A problem from whatever names one: a shipped name, a path, tables, or a problem."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import casadi as ca

from symphys import problems
from symphys.problem.problem import Problem, load_problem, problem_of_tables

Source = str | Path | Mapping[str, Any] | Problem
"""What names a problem."""


def load(source: Source, functions: Mapping[str, ca.Function] | None = None) -> Problem:
    """A problem, validated.

    Args:
        source: the name of a shipped problem, the path of a problem file, or its tables as dicts and lists.
        functions: of controllers with ``function``, by name: casadi functions of (sensed, time, weights).

    Raises:
        ProblemError: names the file and every fault found, each with table, key and what would be valid.
        SymphysError: there is no such file, and no shipped problem of that name.

    Example:
        >>> import symphys
        >>> problem = symphys.load("ball_throw")
        >>> [variable.name for variable in problem.variables]
        ['throw', 'spin']
    """
    given = functions or {}
    if isinstance(source, Problem):
        return source
    if isinstance(source, Mapping):
        return problem_of_tables(source, functions=given)
    return load_problem(problems.find(str(source)), functions=given)
