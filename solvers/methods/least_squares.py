"""The solver ``least_squares``: Levenberg-Marquardt on residuals r with merit = r . r, in x = z / scale.

The loop is that of ``core.levenberg_marquardt``, on the dense Jacobian of all residuals. A step onto a plateau is
refused like one that raises the merit, see ``core.convergence``.

Why not scipy.optimize.least_squares: it can be stopped between iterations but not at the first point that meets the
targets, and its trust region cannot be set when a solve goes on, so an interrupted solve would end elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from symphys.records import dataclass
from symphys.shooting import ShootingProblem
from symphys.solvers.core.checkpoint import revive
from symphys.solvers.core.convergence import MAX_SHORTENINGS, Progress, ends_on_plateau, not_finite, stationary
from symphys.solvers.core.driver import make_solver, stage_of
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, Method, StageContext
from symphys.solvers.core.levenberg_marquardt import (
    MIN_GAIN_RATIO,
    Damped,
    LocalModel,
    Refusal,
    Trial,
    descend,
    first_damping,
    movable,
)
from symphys.solvers.core.line_search import RELATIVE_ROUNDING
from symphys.solvers.core.options import SolverOptions, at_least, require
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point
from symphys.types import Array

NO_SQUARES = (
    "this problem has no residuals: a cost is no sum of squares (write it as one: `squares`, a formula whose squares "
    "add up to the cost), or a net is too large for a Jacobian (use another solver)"
)
STALLED = (
    "no lower merit was found although the Jacobian promises one: it may be wrong there (`symphys check` compares "
    "derivatives with differences), or the point is at a kink (smoothing above 0 rounds it)"
)
SLOW = "the merit hardly falls any more: the point may be at a kink (smoothing above 0 rounds it), or good enough"
BUDGET = "the iterations are used up: raise `iterations`"
NOT_FINITE = "the simulations around the best point are not finite: bound the variables"


@dataclass(frozen=True)
class LeastSquaresOptions(SolverOptions):
    """Options of Levenberg-Marquardt.

    Attributes:
        iterations: largest number of Jacobians in each smoothing stage.
        damping: initial lambda, relative to the largest squared column norm of the scaled Jacobian.
        tolerance: converged where the projected scaled gradient is below tolerance * (1 + merit), or the cosines
            between residuals and Jacobian columns below tolerance.
        patience: stalled after this many iterations without a relative decrease of 1e-5; 0: never.
    """

    iterations: int = 100
    damping: float = 1e-3
    tolerance: float = 1e-8
    patience: int = 10

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        at_least(0, iterations=self.iterations, tolerance=self.tolerance, patience=self.patience)
        require(0 < self.damping < math.inf, "damping", "above 0")


@dataclass(frozen=True, kw_only=True, eq=False)
class LeastSquaresState(Damped):
    """The state between two iterations.

    Attributes:
        iteration: of this stage.
        z: (n,).
        residuals, jacobian: (m,) and (m, n) at z.
        progress: of the merit.
    """

    iteration: int
    z: Array
    residuals: Array
    jacobian: Array
    progress: Progress

    @property
    def merit(self) -> float:
        """The merit at z."""
        return float(self.residuals @ self.residuals)

    @property
    def gradient(self) -> Array:
        """The derivative (n,) of the merit by z."""
        return 2 * self.jacobian.T @ self.residuals


class LevenbergMarquardt(Method[LeastSquaresState]):
    """The method, see ``interface.Method``. It draws nothing: the seed acts only through the start."""

    def __init__(self, context: StageContext, options: LeastSquaresOptions) -> None:
        """Set up one stage."""
        self.evaluator: CountingEvaluator = context.evaluator
        self.start, self.options = context.start, options

    def init(self) -> Iteration[LeastSquaresState] | StopReason:
        """Evaluate the Jacobian at the start, which sets the size of lambda."""
        point = self.evaluator.jacobian(self.start)
        if not point.finite:
            return not_finite(point)
        largest = float(np.max(np.sum((point.jacobian * self.evaluator.scale) ** 2, axis=0), initial=0.0))
        state = LeastSquaresState(
            iteration=0,
            z=point.z,
            residuals=point.residuals,
            jacobian=point.jacobian,
            progress=Progress(point.merit),
            **first_damping(self.options.damping, largest),
        )
        return self._iteration(point, state, math.nan)

    def step(self, state: LeastSquaresState) -> Iteration[LeastSquaresState] | StopReason:
        """Take a step that lowers the merit, with the Jacobian there; lambda grows until there is one."""
        model = DenseModel(self.evaluator, state)
        point, damped = descend(model, state)
        if point is None:
            if model.last is not None and not model.last.finite:
                return not_finite(model.last, NOT_FINITE)
            return StopReason(Status.STALLED, STALLED)
        if isinstance(point, StopReason):
            return point
        taken = replace(
            damped,
            iteration=state.iteration + 1,
            z=point.z,
            residuals=point.residuals,
            jacobian=point.jacobian,
            progress=state.progress.after(point.merit),
        )
        return self._iteration(point, taken, float(np.linalg.norm(point.z - state.z)))

    def terminate(self, state: LeastSquaresState) -> StopReason | None:
        """Return the reason if the state is stationary, the budget used up, or progress has stalled."""
        evaluator, options = self.evaluator, self.options
        flat = evaluator.stationarity(state.z, state.gradient) <= options.tolerance * (1 + state.merit)
        if flat or cosine(evaluator, state) <= options.tolerance:
            return stationary(evaluator, state.z, state.merit)
        if state.iteration >= options.iterations:
            return StopReason(Status.BUDGET, BUDGET)
        return StopReason(Status.STALLED, SLOW) if state.progress.quiet >= (options.patience or math.inf) else None

    def resume(self, saved: dict[str, Any]) -> LeastSquaresState:
        """Implement ``Method.resume``."""
        return revive(LeastSquaresState, saved, Progress)

    def _iteration(self, point: Point, state: LeastSquaresState, step: float) -> Iteration[LeastSquaresState]:
        return Iteration(state, point, self.evaluator.stationarity(point.z, point.gradient), step)


class DenseModel(LocalModel[Array, Point | StopReason]):
    """The quadratic model about a state by the dense Jacobian; see ``LocalModel``. Its steps are new z (n,).

    Attributes:
        merit: at the state.
        last: the point that was evaluated last; None before the first trial.
    """

    last: Point | None = None

    def __init__(self, evaluator: CountingEvaluator, state: LeastSquaresState) -> None:
        """Start without trials."""
        self.evaluator, self.state, self.merit = evaluator, state, state.merit
        self._first, self._plateaus = True, 0
        self._free = movable(state.z, evaluator.lower, evaluator.upper, state.gradient)
        self._jacobian = state.jacobian * evaluator.scale

    def trial(self, damping: float) -> Trial[Array] | Point | StopReason:
        """Evaluate the residuals after a step; end if the first one predicts no more than rounding."""
        evaluator, state, r = self.evaluator, self.state, self.state.residuals
        d = np.zeros(self._free.size)
        d[self._free] = damped_step(self._jacobian[:, self._free], r, damping)
        z = evaluator.clip(state.z + evaluator.scale * d)
        after = r + self._jacobian @ ((z - state.z) / evaluator.scale)
        expected = float(r @ r - after @ after)
        if self._first and expected <= RELATIVE_ROUNDING * self.merit:
            return stationary(evaluator, state.z, self.merit)
        self.last, self._first = evaluator.residuals(z), False
        return Trial(z, self.last.merit if self.last.finite else math.inf, expected)

    def judge(self, z: Array, gain: float) -> Point | StopReason | Refusal:
        """Accept a step that lowers the merit enough and does not end on a plateau; evaluate the Jacobian there."""
        if not gain > MIN_GAIN_RATIO:
            return Refusal.STIFFER
        point = self.evaluator.jacobian(z)
        if not point.finite:
            return not_finite(point, NOT_FINITE)
        if self._plateaus < MAX_SHORTENINGS and ends_on_plateau(
            self.evaluator, point, point.jacobian, self.state.jacobian
        ):
            self._plateaus += 1
            return Refusal.STIFFER
        return point


def damped_step(jacobian: Array, r: Array, damping: float) -> Array:
    """Return (n,) -(J'J + lambda I)^-1 J'r, or -J'(JJ' + lambda I)^-1 r: whichever matrix is smaller."""
    tall = jacobian.shape[0] >= jacobian.shape[1]
    square = jacobian.T @ jacobian if tall else jacobian @ jacobian.T
    floor = 4 * len(square) * float(np.finfo(float).eps) * float(np.trace(square))
    damped = square + max(damping, floor) * np.eye(len(square))
    if tall:
        return np.asarray(-np.linalg.solve(damped, jacobian.T @ r))
    return np.asarray(-jacobian.T @ np.linalg.solve(damped, r))


def cosine(evaluator: CountingEvaluator, state: LeastSquaresState) -> float:
    """Return the largest |cosine| between the residuals and a column of the Jacobian of a free variable."""
    free = movable(state.z, evaluator.lower, evaluator.upper, state.gradient)
    jacobian = state.jacobian[:, free]
    lengths = np.linalg.norm(jacobian, axis=0) * np.linalg.norm(state.residuals)
    acting = lengths > 0
    return float(np.max(np.abs(jacobian.T @ state.residuals)[acting] / lengths[acting], initial=0.0))


def refusal(problem: ShootingProblem) -> str:
    """Return why the solver is not for a problem; empty if it is."""
    return "" if problem.squares else NO_SQUARES


LEAST_SQUARES = make_solver(
    "least_squares",
    "Levenberg-Marquardt within bounds, for costs that are sums of squares",
    LeastSquaresOptions,
    stage_of(LevenbergMarquardt),
    refusal=refusal,
    threaded=True,
)
