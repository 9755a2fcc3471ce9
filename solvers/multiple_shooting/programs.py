"""The nonlinear programs of one stage of smoothing: with any references, on one grid and in one layout."""

from __future__ import annotations

import numpy as np

from symphys.shooting import StagedMotion, StagedProblem
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.multiple_shooting.chart import curved_columns, interpolated
from symphys.solvers.multiple_shooting.grid import IntervalGrid
from symphys.solvers.multiple_shooting.layout import shared, staged
from symphys.solvers.multiple_shooting.nlp import MultipleShootingNlp
from symphys.solvers.multiple_shooting.shots import IntervalSteps, ShootingPlan
from symphys.types import Array


class Programs:
    """Makes the program of a stage of smoothing at any references, with the same grid and layout."""

    def __init__(
        self,
        problem: StagedProblem,
        grid: IntervalGrid,
        evaluator: CountingEvaluator,
        z: Array,
        nodes: Array,
        in_stages: bool,
        exact: bool,
    ) -> None:
        """Find the stages that limits depend on, and what all steps share, at lines between the nodes.

        Args:
            problem: what is solved.
            grid: its intervals.
            evaluator: has the scale of z, and the smoothing.
            z: (n,) of the guess.
            nodes: (M, nx) of the guess.
            in_stages: whether the layout is in stages, for FATROP.
            exact: whether Hessians are exact.
        """
        self.problem, self.grid, self.evaluator, self.exact = problem, grid, evaluator, exact
        corners = np.concatenate([problem.start(z[None]), nodes])
        x = interpolated(problem, corners, np.linspace(0, 1, problem.steps + 1))
        u = np.asarray(problem.weights @ z).reshape(problem.steps, problem.input_size)
        motion = StagedMotion(z, x, u, evaluator.smoothing)
        self.steps, self.curved = IntervalSteps(problem, motion), curved_columns(problem, nodes)
        stages: list[set[int]] = [set() for _ in problem.lower]
        if stages:
            _, by_state, by_input, _ = problem.limit_slopes(motion)
            owner = self.grid.stage_of_state
            for slopes, size in ((by_state, problem.tangent_size), (by_input, problem.input_size)):
                rows, columns = slopes.tocoo().coords
                for row, of in zip(rows.tolist(), owner[columns // size].tolist(), strict=True):
                    stages[row].add(of)
        found = [sorted(each) or [0] for each in stages]
        count = self.grid.intervals + 1
        self.limit_rows = [np.array([r for r, of in enumerate(found) if j in of], np.int64) for j in range(count)]
        variables = evaluator.problem.n
        self.layout = staged(self.grid, variables, found) if in_stages else shared(self.grid, variables, len(stages))

    def at(self, reference: Array) -> MultipleShootingNlp:
        """Return the program with tangents at these states (M, nx)."""
        plan = ShootingPlan(self.problem, self.grid, self.steps, reference, self.evaluator.smoothing, self.curved)
        return MultipleShootingNlp(plan, self.layout, self.limit_rows, self.evaluator.scale, self.exact)
