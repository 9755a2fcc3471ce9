"""Levenberg-Marquardt within bounds, on residuals r with merit = r . r, in x = z / scale.

Each step solves (J'J + lambda I) d = -J'r over the variables that are free: those at a bound that the gradient
pushes against are held (active set), and the step is projected into the bounds. lambda follows the gain ratio, the
decrease of the merit over that of the linear model (Nielsen 1999; Madsen, Nielsen, Tingleff 2004, algorithm 3.16).
A step onto a plateau is refused like one that raises the merit, see ``vanishing_gradient``.

Why not scipy.optimize.least_squares: it can be stopped between iterations but not at the first point that meets the
targets, and its trust region cannot be set when a solve goes on, so an interrupted solve would end elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from symphys.shooting import ShootingProblem
from symphys.solvers.core.checkpoint import revive
from symphys.solvers.core.convergence import Progress, not_finite, stationary
from symphys.solvers.core.driver import iterating, make_solver
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, Method, StageContext
from symphys.solvers.core.line_search import ROUNDING
from symphys.solvers.core.options import SolverOptions, at_least, require
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point
from symphys.solvers.core.vanishing_gradient import REFUSALS, vanished
from symphys.types import Array

LOOSEST = 1 / 3
"""lambda falls at most to this share after a step that went as foreseen."""
WORTH = 1e-4
"""A step is taken if the merit falls by more than this share of what the linear model expects."""
STIFFEST = 1e20
"""lambda over the largest squared column of the first Jacobian: beyond it a step is no step."""
NO_SQUARES = (
    "this problem has no residuals: a cost is no sum of squares (write it as one: `squares`, a formula whose squares "
    "add up to the cost), or a net is too large or bodies are too many for a Jacobian (use another solver)"
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
        iterations: Jacobians at most (more where a plateau is refused), in each stage of smoothing.
        damping: first lambda, as a share of the largest squared column of the first scaled Jacobian.
        tolerance: converged where the projected scaled gradient is below tolerance * (1 + merit), or where no column
            of the Jacobian is nearer to the residuals than this cosine.
        patience: stalled where the merit has not fallen by 1e-5 of itself in so many iterations; 0 goes on regardless.
    """

    iterations: int = 100
    damping: float = 1e-3
    tolerance: float = 1e-8
    patience: int = 10

    def __post_init__(self) -> None:
        """ValueError that names the option and what would be valid."""
        super().__post_init__()
        at_least(0, iterations=self.iterations, tolerance=self.tolerance, patience=self.patience)
        require(0 < self.damping < math.inf, "damping", "above 0")


@dataclass(frozen=True)
class LeastSquaresState:
    """Between two iterations.

    Attributes:
        iteration: of this stage.
        z: (n,).
        residuals, jacobian: (m,) and (m, n) at z.
        damping: lambda.
        growth: the factor on lambda after a step that is refused.
        stiffest: a lambda beyond which the search for a step is given up.
        progress: of the merit.
    """

    iteration: int
    z: Array
    residuals: Array
    jacobian: Array
    damping: float
    growth: float
    stiffest: float
    progress: Progress

    @property
    def merit(self) -> float:
        """At z."""
        return float(self.residuals @ self.residuals)

    @property
    def gradient(self) -> Array:
        """(n,) of the merit by z."""
        return 2 * self.jacobian.T @ self.residuals


class LevenbergMarquardt(Method[LeastSquaresState]):
    """The method, see ``interface.Method``. Nothing is drawn: the seed acts through the start alone."""

    def __init__(self, context: StageContext, options: LeastSquaresOptions) -> None:
        """For one stage."""
        self.evaluator: CountingEvaluator = context.evaluator
        self.start, self.options = context.start, options

    def init(self) -> Iteration[LeastSquaresState] | StopReason:
        """The Jacobian at the start sets the size of lambda."""
        point = self.evaluator.jacobian(self.start)
        if not point.finite:
            return not_finite(point)
        size = float(np.max(np.sum((point.jacobian * self.evaluator.scale) ** 2, axis=0), initial=0.0)) or 1.0
        evaluated, progress = (point.z, point.residuals, point.jacobian), Progress(point.merit)
        state = LeastSquaresState(0, *evaluated, self.options.damping * size, 2.0, STIFFEST * size, progress)
        return self._iteration(point, state, math.nan)

    def step(self, state: LeastSquaresState) -> Iteration[LeastSquaresState] | StopReason:
        """One step that lowers the merit, and the Jacobian there; lambda grows until there is one."""
        evaluator, first_try, refused = self.evaluator, True, 0
        while state.damping <= state.stiffest:
            z, promised = self._candidate(state)
            if first_try and promised <= ROUNDING * state.merit:
                return stationary(evaluator, state.z, state.merit)
            trial, first_try = evaluator.residuals(z), False
            gain = (state.merit - trial.merit) / promised if promised > 0 else -math.inf
            if trial.finite and gain > WORTH:
                point = evaluator.jacobian(z)
                enough = refused == REFUSALS or not point.finite
                if enough or not vanished(evaluator, point, point.jacobian, state.jacobian):
                    return self._accept(state, point, gain)
                refused += 1
            state = replace(state, damping=state.damping * state.growth, growth=2 * state.growth)
        return StopReason(Status.STALLED, STALLED) if trial.finite else not_finite(trial, NOT_FINITE)

    def terminate(self, state: LeastSquaresState) -> StopReason | None:
        """Whether the state is stationary, the budget used up, or the descent gets nowhere."""
        evaluator, options = self.evaluator, self.options
        flat = evaluator.stationarity(state.z, state.gradient) <= options.tolerance * (1 + state.merit)
        if flat or cosine(evaluator, state) <= options.tolerance:
            return stationary(evaluator, state.z, state.merit)
        if state.iteration >= options.iterations:
            return StopReason(Status.BUDGET, BUDGET)
        return StopReason(Status.STALLED, SLOW) if state.progress.quiet >= (options.patience or math.inf) else None

    def resume(self, saved: dict[str, Any]) -> LeastSquaresState:
        """See ``Method``."""
        return revive(LeastSquaresState, saved, Progress)

    def _iteration(self, point: Point, state: LeastSquaresState, step: float) -> Iteration[LeastSquaresState]:
        return Iteration(state, point, self.evaluator.stationarity(point.z, point.gradient), step)

    def _candidate(self, state: LeastSquaresState) -> tuple[Array, float]:
        """The next z (n,), and by how much the linear model expects it to lower the merit."""
        scale, r, free = self.evaluator.scale, state.residuals, movable(self.evaluator, state)
        jacobian = state.jacobian * scale
        d = np.zeros(free.size)
        d[free] = damped_step(jacobian[:, free], r, state.damping)
        z = self.evaluator.clip(state.z + scale * d)
        expected = r + jacobian @ ((z - state.z) / scale)
        return z, float(r @ r - expected @ expected)

    def _accept(self, state: LeastSquaresState, point: Point, gain: float) -> Iteration[LeastSquaresState] | StopReason:
        """Take the step; lambda falls with the gain ratio."""
        if not point.finite:
            return not_finite(point, NOT_FINITE)
        damping = state.damping * max(LOOSEST, 1 - (2 * gain - 1) ** 3)
        evaluated, progress = (point.z, point.residuals, point.jacobian), state.progress.after(point.merit)
        taken = LeastSquaresState(state.iteration + 1, *evaluated, damping, 2.0, state.stiffest, progress)
        return self._iteration(point, taken, float(np.linalg.norm(point.z - state.z)))


def damped_step(jacobian: Array, r: Array, damping: float) -> Array:
    """(n,) -(J'J + lambda I)^-1 J'r, which is also -J'(JJ' + lambda I)^-1 r: whichever matrix is smaller."""
    tall = jacobian.shape[0] >= jacobian.shape[1]
    square = jacobian.T @ jacobian if tall else jacobian @ jacobian.T
    floor = 4 * len(square) * float(np.finfo(float).eps) * float(np.trace(square))
    factor = scipy.linalg.cho_factor(square + max(damping, floor) * np.eye(len(square)))
    if tall:
        return np.asarray(-scipy.linalg.cho_solve(factor, jacobian.T @ r))
    return np.asarray(-jacobian.T @ scipy.linalg.cho_solve(factor, r))


def movable(evaluator: CountingEvaluator, state: LeastSquaresState) -> NDArray[np.bool_]:
    """(n,): False for a variable at a bound that the gradient pushes against."""
    at_lower = (state.z <= evaluator.lower) & (state.gradient > 0)
    at_upper = (state.z >= evaluator.upper) & (state.gradient < 0)
    return ~(at_lower | at_upper)


def cosine(evaluator: CountingEvaluator, state: LeastSquaresState) -> float:
    """The largest |cosine| between the residuals and a column of the Jacobian that is free to act on them."""
    jacobian = state.jacobian[:, movable(evaluator, state)]
    lengths = np.linalg.norm(jacobian, axis=0) * np.linalg.norm(state.residuals)
    acting = lengths > 0
    return float(np.max(np.abs(jacobian.T @ state.residuals)[acting] / lengths[acting], initial=0.0))


def refusal(problem: ShootingProblem) -> str:
    """Why the solver is not for a problem."""
    return "" if problem.squares else NO_SQUARES


LEAST_SQUARES = make_solver(
    "least_squares",
    "Levenberg-Marquardt within bounds, for costs that are sums of squares",
    LeastSquaresOptions,
    iterating(LevenbergMarquardt),
    refusal=refusal,
    threaded=True,
)
