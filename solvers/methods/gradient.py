"""First-order descent: d merit / dz by the adjoint of the rollout, and one line search along a direction at a time.

A direction (``core.directions``) is projected into the bounds, then shortened until the merit is below the largest of
the last few (``backtracking``; Grippo, Lampariello, Lucidi 1986; with bounds and the spectral step this is the SPG2 of
Birgin, Martinez, Raydan 2000). A direction that does not descend is replaced by that of an empty memory.
A step onto a plateau is refused and shortened, see ``core.convergence``.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from symphys.records import dataclass
from symphys.solvers.core.checkpoint import revive
from symphys.solvers.core.convergence import (
    MAX_SHORTENINGS,
    SHORTENING_FACTOR,
    Progress,
    ends_on_plateau,
    not_finite,
    stationary,
)
from symphys.solvers.core.directions import DIRECTIONS, DirectionMemory, MomentumWeights, learn_length
from symphys.solvers.core.driver import make_solver, stage_of
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, Method, StageContext
from symphys.solvers.core.line_search import RELATIVE_ROUNDING, backtrack
from symphys.solvers.core.options import SolverOptions, at_least, require
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point
from symphys.types import Array

RATES: dict[str, tuple[float, ...]] = {
    "spectral": (1.0,),
    "gradient": (1.0,),
    "momentum": (1.0,),
    "adam": (2.0, 1.0, 0.1, 0.05, 0.01),
}
"""What ``rates = ()`` stands for; that of Adam is the published schedule of the ball throw."""
STALLED = (
    "no lower merit was found along the gradient: it may be wrong there (`symphys check` compares it with "
    "differences), the point may be at a kink (smoothing above 0 rounds it), or only rounding is left to gain"
)
SLOW = (
    "the merit hardly falls any more: the point may be at a kink (smoothing above 0 rounds it), in a narrow valley "
    "(other scales or least squares), or good enough"
)
BUDGET = "the iterations are used up: raise `iterations`, or look at the trace for rates that do not fit"
NOT_FINITE = "the simulation along the descent direction is not finite: bound the variables or lower the rates"


@dataclass(frozen=True)
class GradientOptions(SolverOptions):
    """Options of first-order descent.

    Attributes:
        method: direction of a step.
        iterations: largest number of gradients in each smoothing stage.
        rates: learning rates, each for an equal share of the iterations; default: by method. Factors on the scaled
            gradient (gradient, momentum), steps in units of scale (adam), or the length of the first step (spectral).
        momentum: share of the last direction that is kept.
        betas: decay rates of Adam's two moments.
        clip: largest norm of the scaled gradient; a longer one is shortened to it.
        backtracking: number of previous merits with whose maximum a step is compared; 1: Armijo's rule; 0: no line
            search.
        tolerance: converged where the projected scaled gradient is below tolerance * (1 + |merit|).
        patience: stalled after this many iterations without a relative decrease of 1e-5; 0: never.
    """

    method: Literal["spectral", "gradient", "momentum", "adam"] = "spectral"
    iterations: int = 300
    rates: tuple[float, ...] = ()
    momentum: float = 0.9
    betas: tuple[float, float] = (0.5, 0.9)
    clip: float = math.inf
    backtracking: int = 5
    tolerance: float = 1e-6
    patience: int = 30

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        require(self.method in DIRECTIONS, "method", f"one of {', '.join(DIRECTIONS)}")
        at_least(0, iterations=self.iterations, backtracking=self.backtracking)
        at_least(0, tolerance=self.tolerance, patience=self.patience)
        require(all(rate > 0 for rate in self.rates), "rates", "positive numbers")
        require(self.method != "spectral" or len(self.rates) < 2, "rates", "one number with the spectral method")
        require(all(0 <= share < 1 for share in (self.momentum, *self.betas)), "momentum, betas", "in [0, 1)")
        require(self.clip > 0, "clip", "above 0")

    def rate(self, iteration: int) -> float:
        """Return the rate of an iteration: each of the rates has an equal share of the iterations."""
        return self.schedule[self.share(iteration)]

    def at_last_rate(self, iteration: int) -> bool:
        """Whether the iteration uses the last rate."""
        return self.share(iteration) == len(self.schedule) - 1

    @property
    def schedule(self) -> tuple[float, ...]:
        """The rates in their order, at least one."""
        return self.rates or RATES[self.method]

    def share(self, iteration: int) -> int:
        """Return the index of the rate of an iteration."""
        return min(iteration * len(self.schedule) // max(self.iterations, 1), len(self.schedule) - 1)


@dataclass(frozen=True)
class GradientState:
    """The state between two iterations.

    Attributes:
        iteration: of this stage.
        z, gradient: (n,).
        merits: the last ones, the present one at the end.
        memory: of the direction.
        progress: of the merit.
    """

    iteration: int
    z: Array
    gradient: Array
    merits: tuple[float, ...]
    memory: DirectionMemory
    progress: Progress


class GradientDescent(Method[GradientState]):
    """The method, see ``interface.Method``. It draws nothing: the seed acts only through the start."""

    def __init__(self, context: StageContext, options: GradientOptions) -> None:
        """Set up one stage."""
        self.evaluator: CountingEvaluator = context.evaluator
        self.start, self.options = context.start, options

    def init(self) -> Iteration[GradientState] | StopReason:
        """Evaluate the gradient at the start."""
        point = self.evaluator.gradient(self.start)
        if not point.finite:
            return not_finite(point)
        z = self.start
        memory, progress = DirectionMemory.empty(z.size), Progress(point.merit)
        return self._iteration(point, GradientState(0, z, point.gradient, (point.merit,), memory, progress), math.nan)

    def step(self, state: GradientState) -> Iteration[GradientState] | StopReason:
        """Compute a direction, search along it, and evaluate the new gradient."""
        scale, options = self.evaluator.scale, self.options
        step, memory = self._direction(state)
        point = self._follow(state, step)
        if isinstance(point, StopReason):
            return point
        if not point.finite:
            return not_finite(point, NOT_FINITE)
        z = point.z
        if options.method == "spectral":
            memory = learn_length(memory, (z - state.z) / scale, (point.gradient - state.gradient) * scale)
        merits = (*state.merits, point.merit)[-max(options.backtracking, 1) :]
        progress = state.progress.after(point.merit) if options.at_last_rate(state.iteration) else Progress(point.merit)
        following = GradientState(state.iteration + 1, z, point.gradient, merits, memory, progress)
        return self._iteration(point, following, float(np.linalg.norm(z - state.z)))

    def terminate(self, state: GradientState) -> StopReason | None:
        """Stop if the state is stationary, the budget used up, or the descent stalls."""
        options, merit = self.options, state.merits[-1]
        if self.evaluator.stationarity(state.z, state.gradient) <= options.tolerance * (1 + abs(merit)):
            return stationary(self.evaluator, state.z, merit)
        if state.iteration >= options.iterations:
            return StopReason(Status.BUDGET, BUDGET)
        return StopReason(Status.STALLED, SLOW) if state.progress.quiet >= (options.patience or math.inf) else None

    def resume(self, saved: dict[str, Any]) -> GradientState:
        """Implement ``Method.resume``."""
        return revive(GradientState, saved, DirectionMemory, Progress)

    def _iteration(self, point: Point, state: GradientState, step: float) -> Iteration[GradientState]:
        return Iteration(state, point, self.evaluator.stationarity(point.z, point.gradient), step)

    def _direction(self, state: GradientState) -> tuple[Array, DirectionMemory]:
        """Return the step (n,) in z to a point within the bounds; downhill, unless every step is accepted."""
        evaluator, options = self.evaluator, self.options
        g = shortened(state.gradient * evaluator.scale, options.clip)
        weights, rate = MomentumWeights(options.momentum, options.betas), options.rate(state.iteration)
        for memory in (state.memory, DirectionMemory.empty(g.size)):
            d, memory = DIRECTIONS[options.method](g, memory, rate, weights)
            step = evaluator.clip(state.z + evaluator.scale * d) - state.z
            if state.gradient @ step < 0 or not options.backtracking:
                break
        return step, memory

    def _follow(self, state: GradientState, step: Array) -> Point | StopReason:
        """Return the next point with its gradient; steps onto a plateau are refused a few times and shortened."""
        plateau: Point | None = None
        for _ in range(MAX_SHORTENINGS + 1):
            z = self._search(state, step)
            if isinstance(z, StopReason):
                return plateau or z
            point = self.evaluator.gradient(z)
            flat = point.finite and self.options.backtracking > 0
            if not (flat and ends_on_plateau(self.evaluator, point, point.gradient, state.gradient)):
                return point
            plateau, step = point, SHORTENING_FACTOR * (z - state.z)
        return point

    def _search(self, state: GradientState, step: Array) -> Array | StopReason:
        """Return the next z (n,) along the step."""
        evaluator = self.evaluator
        if not self.options.backtracking:
            return evaluator.clip(state.z + step)
        merit, slope = state.merits[-1], float(state.gradient @ step)
        found = backtrack(evaluator, state.z, step, slope, merit, max(state.merits))
        if found.point:
            return found.point.z
        if found.not_finite:
            return StopReason(Status.NOT_FINITE, NOT_FINITE)
        if -slope <= RELATIVE_ROUNDING * abs(merit):
            return stationary(evaluator, state.z, merit)
        return StopReason(Status.STALLED, STALLED)


def shortened(g: Array, longest: float) -> Array:
    """Return the gradient, its norm clipped to ``longest``."""
    norm = float(np.linalg.norm(g))
    return g * (longest / norm) if norm > longest else g


GRADIENT = make_solver(
    "gradient",
    "first-order descent by the adjoint of the rollout",
    GradientOptions,
    stage_of(GradientDescent),
    threaded=True,
)
