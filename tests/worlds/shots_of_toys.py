"""Multiple shooting of the toys step by step: solves, programs, and what is known of their answers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from tools.repeats import few

from symphys.shooting import ShootingProblem
from symphys.solvers import SOLVERS, MultipleShootingOptions, Outcome
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.point import Incumbent
from symphys.solvers.methods.multiple_shooting import DEFECT
from symphys.solvers.multiple_shooting.chart import interpolated
from symphys.solvers.multiple_shooting.grid import make_grid
from symphys.solvers.multiple_shooting.nlp import MultipleShootingNlp, Programs

SWING = 98.637754
"""The least objective of the acrobot's swing-up that is known."""
LINE = ((0.0, 0.0, 0.0, 0.0), (np.pi, 0.0, 0.0, 0.0))
WAYS = [("ipopt", "gauss-newton"), ("ipopt", "exact"), ("fatrop", "gauss-newton"), ("fatrop", "exact")]
every_way = few(("backend", "hessian"), WAYS, 1)
every_backend = few("backend", ["ipopt", "fatrop"], 1)


def solve(problem: ShootingProblem, start: Any = None, **options: Any) -> Outcome:
    """The rest of the arguments of a solve are among the options; ``nodes``: states that lines of the guess join."""
    if "nodes" in options:
        problem = replace(problem, guessed_states=lines(problem, options.pop("nodes")))
    more = {name: options.pop(name) for name in ("monitor", "checkpoint", "keep", "log") if name in options}
    z = problem.start(0) if start is None else start
    return SOLVERS["multiple_shooting"].solve(problem, z, MultipleShootingOptions(**options), **more)


def lines(problem: ShootingProblem, corners: Any) -> Any:
    """The guess of the states on lines between some at equal times, from the first state to the last."""
    assert problem.staged is not None
    chain = problem.staged()
    return lambda z, ticks, smoothing: interpolated(chain, np.array(corners, float), ticks / chain.steps)


def program(problem: ShootingProblem, z: Any, nodes: Any = None, **options: Any) -> MultipleShootingNlp:
    """The nonlinear program with references at the rollout of z, or at given nodes."""
    assert problem.staged is not None
    chain = problem.staged()
    evaluator = CountingEvaluator(problem, 0.0, Incumbent(stop_when_met=False))
    chosen = MultipleShootingOptions(**options)
    grid = make_grid(chain, chosen.steps_between_nodes)
    nodes = chain.roll_out(z, 0.0).x[grid.starts[1:]] if nodes is None else nodes
    return Programs(chain, grid, evaluator, z, nodes, chosen.backend == "fatrop", chosen.hessian == "exact").at(nodes)


def defect(found: Outcome) -> float:
    """Of the last iterate."""
    return found.trace[-1].outputs[DEFECT]
