"""Levenberg-Marquardt within bounds, on residuals r with merit = r . r, in x = z / scale.

Each step solves (J'J + lambda I) d = -J'r over the variables that are free: those at a bound that the gradient
pushes against are held (active set), and the step is projected into the bounds. lambda follows the gain ratio, the
decrease of the merit over that of the linear model (Nielsen 1999; Madsen, Nielsen, Tingleff 2004, algorithm 3.16).
A step onto a plateau is refused like one that raises the merit, see ``plateau``.

Why not scipy.optimize.least_squares: it can be stopped between iterations but not at the first point that meets the
targets, and its trust region cannot be set when a solve goes on, so an interrupted solve would end elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from symphys.shooting import ShootingProblem
from symphys.solvers.core.checkpoint import revive
from symphys.solvers.core.continuation import Request
from symphys.solvers.core.driver import begin, not_finite, run
from symphys.solvers.core.evaluator import Meter, Verdict
from symphys.solvers.core.interface import Log, Solver
from symphys.solvers.core.line_search import ROUNDING
from symphys.solvers.core.merit_probe import believed
from symphys.solvers.core.options import at_least, require
from symphys.solvers.core.outcome import Array, Monitor, Outcome, Status
from symphys.solvers.core.point import Point
from symphys.solvers.core.progress import Progress
from symphys.solvers.core.vanishing_gradient import REFUSALS, lost

LOOSEST = 1 / 3
"""lambda falls at most to this share after a step that went as foreseen."""
WORTH = 1e-4
"""A step is taken if the merit falls by more than this share of what the linear model expects."""
STIFFEST = 1e20
"""lambda over the largest squared column of the first Jacobian: beyond it a step is no step."""
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
class LeastSquaresOptions:
    """Options of Levenberg-Marquardt.

    Attributes:
        iterations: Jacobians at most (more where a plateau is refused), in each stage of smoothing.
        damping: first lambda, as a share of the largest squared column of the first scaled Jacobian.
        tolerance: converged where the projected scaled gradient is below tolerance * (1 + merit), or where no column
            of the Jacobian is nearer to the residuals than this cosine.
        patience: stalled where the merit has not fallen by 1e-5 of itself in so many iterations; 0 goes on regardless.
    """

    __pydantic_config__: ClassVar[dict[str, object]] = {"extra": "forbid"}

    iterations: int = 100
    damping: float = 1e-3
    tolerance: float = 1e-8
    patience: int = 10

    def __post_init__(self) -> None:
        """ValueError that names the option and says what would be valid."""
        at_least(0, iterations=self.iterations, tolerance=self.tolerance, patience=self.patience)
        require(0 < self.damping < math.inf, "damping", "above 0")


@dataclass(frozen=True)
class State:
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


def solve(
    problem: ShootingProblem,
    start: Array,
    options: LeastSquaresOptions,
    seed: int = 0,
    monitor: Monitor | None = None,
    checkpoint: dict[str, object] | None = None,
    log: Log | None = None,
) -> Outcome:
    """Descend; nothing is drawn, so the seed acts through ``start`` alone. See ``interface.Solve``."""

    def stage(meter: Meter, z: Array, saved: dict[str, object] | None) -> Verdict:
        if not problem.squares:
            return Verdict(Status.NOT_APPLICABLE, NO_SQUARES)
        step: State | Verdict = revive(State, saved, Progress) if saved else first(meter, options, z)
        while isinstance(step, State):
            step = finished(meter, options, step) or advance(meter, step)
        return step

    return run(Request("least_squares", problem, start, monitor, checkpoint, log), stage)


def first(meter: Meter, options: LeastSquaresOptions, z: Array) -> State:
    """The Jacobian at the start sets the size of lambda."""
    point = begin(meter.jacobian(z))
    size = float(np.max(np.sum((point.jacobian * meter.scale) ** 2, axis=0), initial=0.0)) or 1.0
    evaluated = (point.z, point.residuals, point.jacobian)
    state = State(0, *evaluated, options.damping * size, 2.0, STIFFEST * size, Progress(point.merit))
    return complete(meter, point, state, math.nan)


def complete(meter: Meter, point: Point, state: State, length: float) -> State:
    """End an iteration, ``length`` in z away from the last one."""
    meter.commit(point, state, meter.stationarity(point.z, point.gradient), length)
    return state


def finished(meter: Meter, options: LeastSquaresOptions, state: State) -> Verdict | None:
    """Whether the state is stationary, the budget used up, or the descent gets nowhere."""
    flat = meter.stationarity(state.z, state.gradient) <= options.tolerance * (1 + state.merit)
    if flat or cosine(meter, state) <= options.tolerance:
        return believed(meter, state.z, state.merit)
    if state.iteration >= options.iterations:
        return Verdict(Status.BUDGET, BUDGET)
    return Verdict(Status.STALLED, SLOW) if state.progress.quiet >= (options.patience or math.inf) else None


def advance(meter: Meter, state: State) -> State | Verdict:
    """One step that lowers the merit, and the Jacobian there."""
    first_try, refused = True, 0
    while state.damping <= state.stiffest:
        z, promised = candidate(meter, state)
        if first_try and promised <= ROUNDING * state.merit:
            return believed(meter, state.z, state.merit)
        trial, first_try = meter.residuals(z), False
        gain = (state.merit - trial.merit) / promised if promised > 0 else -math.inf
        if trial.finite and gain > WORTH:
            point = meter.jacobian(z)
            if refused == REFUSALS or not (point.finite and lost(meter, point, point.jacobian, state.jacobian)):
                return accept(meter, state, point, gain)
            refused += 1
        state = replace(state, damping=state.damping * state.growth, growth=2 * state.growth)
    return Verdict(Status.STALLED, STALLED) if trial.finite else not_finite(trial, NOT_FINITE)


def candidate(meter: Meter, state: State) -> tuple[Array, float]:
    """The next z (n,), and by how much the linear model expects it to lower the merit."""
    jacobian, r, free = state.jacobian * meter.scale, state.residuals, movable(meter, state)
    d = np.zeros(free.size)
    d[free] = damped_step(jacobian[:, free], r, state.damping)
    z = meter.clip(state.z + meter.scale * d)
    expected = r + jacobian @ ((z - state.z) / meter.scale)
    return z, float(r @ r - expected @ expected)


def damped_step(jacobian: Array, r: Array, damping: float) -> Array:
    """(n,) -(J'J + lambda I)^-1 J'r, which is also -J'(JJ' + lambda I)^-1 r: whichever matrix is smaller."""
    tall = jacobian.shape[0] >= jacobian.shape[1]
    square = jacobian.T @ jacobian if tall else jacobian @ jacobian.T
    floor = 4 * len(square) * float(np.finfo(float).eps) * float(np.trace(square))
    factor = scipy.linalg.cho_factor(square + max(damping, floor) * np.eye(len(square)))
    if tall:
        return np.asarray(-scipy.linalg.cho_solve(factor, jacobian.T @ r))
    return np.asarray(-jacobian.T @ scipy.linalg.cho_solve(factor, r))


def accept(meter: Meter, state: State, point: Point, gain: float) -> State | Verdict:
    """Take the step; lambda falls with the gain ratio."""
    if not point.finite:
        return not_finite(point, NOT_FINITE)
    damping = state.damping * max(LOOSEST, 1 - (2 * gain - 1) ** 3)
    evaluated = (point.z, point.residuals, point.jacobian)
    progress = state.progress.after(point.merit)
    taken = State(state.iteration + 1, *evaluated, damping, 2.0, state.stiffest, progress)
    return complete(meter, point, taken, float(np.linalg.norm(point.z - state.z)))


def movable(meter: Meter, state: State) -> NDArray[np.bool_]:
    """(n,): False for a variable at a bound that the gradient pushes against."""
    at_lower = (state.z <= meter.lower) & (state.gradient > 0)
    at_upper = (state.z >= meter.upper) & (state.gradient < 0)
    return ~(at_lower | at_upper)


def cosine(meter: Meter, state: State) -> float:
    """The largest |cosine| between the residuals and a column of the Jacobian that is free to act on them."""
    jacobian = state.jacobian[:, movable(meter, state)]
    lengths = np.linalg.norm(jacobian, axis=0) * np.linalg.norm(state.residuals)
    seen = lengths > 0
    return float(np.max(np.abs(jacobian.T @ state.residuals)[seen] / lengths[seen], initial=0.0))


LEAST_SQUARES = Solver(
    "least_squares",
    "Levenberg-Marquardt within bounds, for costs that are sums of squares",
    LeastSquaresOptions,
    solve,
    threaded=True,
)
