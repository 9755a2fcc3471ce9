"""Control-limited DDP with Gauss-Newton Hessians: Newton steps along the structure of time, with feedback."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from itertools import tee
from typing import Any

import numpy as np

from symphys.records import dataclass
from symphys.shooting import Linearized, ShootingProblem, StagedMotion, StagedProblem
from symphys.solvers.core.checkpoint import revive
from symphys.solvers.core.convergence import Progress, converged, not_finite, stationary
from symphys.solvers.core.driver import make_solver, stage_of
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, Method, StageContext
from symphys.solvers.core.options import SolverOptions, at_least, require
from symphys.solvers.core.outcome import Counts, Status, StopReason
from symphys.solvers.core.point import Point
from symphys.solvers.ddp.backward_pass import Policy
from symphys.solvers.ddp.forward_pass import MotionBatch
from symphys.solvers.ddp.gains import gains_about
from symphys.solvers.ddp.iteration import BestMotion, LocalExpansion
from symphys.solvers.ddp.knots import PaddedKnots, knot_steps
from symphys.types import Array

MIN_GAIN_RATIO = 1e-4
"""Least ratio of actual to expected decrease with which a step is taken."""
MAX_DAMPING, MIN_DAMPING = 1e12, 1e-12
"""Bounds of the damping."""
VIOLATION_DECREASE = 0.25
"""The penalty grows if the violation has not fallen to this share of itself."""
NO_STEPS = "ilqr needs a problem that can be seen step by step: take gradient, ipopt or cma"
STALLED = "no step lowers the objective: a kink (smoothing above 0 rounds it), or good enough"
SLOW = "the objective hardly falls any more: a kink (smoothing above 0 rounds it), or good enough"
BUDGET = "the iterations are used up: raise `iterations`"


@dataclass(frozen=True)
class IlqrOptions(SolverOptions):
    """Options of iLQR.

    Attributes:
        iterations: largest number of linearisations in each smoothing stage.
        damping: initial regularisation of the control Hessian, in units of scale.
        tolerance: converged where the expected decrease is below tolerance * (1 + |objective|).
        patience: stalled after this many iterations without a relative decrease of 1e-5; 0: never.
        penalty: initial factor on the penalties of the constraints.
        growth: factor on the penalty when violations do not decrease.
    """

    iterations: int = 300
    damping: float = 1e-4
    tolerance: float = 1e-9
    patience: int = 20
    penalty: float = 1.0
    growth: float = 10.0

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        at_least(0, iterations=self.iterations, tolerance=self.tolerance, patience=self.patience)
        require(0 < self.damping < math.inf, "damping", "above 0")
        require(0 < self.penalty < math.inf, "penalty", "above 0")
        require(1 < self.growth < math.inf, "growth", "above 1")


@dataclass(frozen=True)
class IlqrState:
    """The state between two iterations.

    Attributes:
        iteration: of this stage.
        z: (len(z),).
        value: of the augmented objective there.
        damping, growth: lambda, and the factor on it after a step that is refused.
        multipliers, penalties: (c,) of the limits.
        violated: the largest violation when the multipliers were set.
        settled: whether the last step of these multipliers found nothing to gain.
        progress: of the objective.
    """

    iteration: int
    z: Array
    value: float
    damping: float
    growth: float
    multipliers: Array
    penalties: Array
    violated: float
    settled: bool
    progress: Progress


class Ilqr(Method[IlqrState]):
    """The method, see ``interface.Method``. It draws nothing: the seed acts only through the start."""

    def __init__(self, context: StageContext, options: IlqrOptions) -> None:
        """Set up one stage."""
        self.evaluator: CountingEvaluator = context.evaluator
        self.start, self.options = context.start, options

    @cached_property
    def staged(self) -> StagedProblem:
        """The problem, step by step."""
        make = self.evaluator.problem.staged
        assert make is not None, "refusal() has looked"
        return make()

    @cached_property
    def knots(self) -> PaddedKnots:
        """The knots of the steps, with the bounds of z."""
        return PaddedKnots.of(knot_steps(self.staged), self.evaluator.lower, self.evaluator.upper)

    def init(self) -> Iteration[IlqrState] | StopReason:
        """Simulate the guess."""
        point = self.evaluator.along(self._motion(self.start))
        if not point.finite:
            return not_finite(point)
        limits = len(self.staged.lower)
        penalties = 2 * self.options.penalty * self.staged.penalties
        state = IlqrState(
            0, point.z, math.nan, self.options.damping, 2.0, np.zeros(limits), penalties, math.inf, False,
            Progress(point.merit),
        )  # fmt: skip
        value = float(self._values(state, self._single(point.z))[0])
        return self._iteration(point, replace(state, value=value), math.nan, math.nan)

    def step(self, state: IlqrState) -> Iteration[IlqrState] | StopReason:
        """Linearise and take the best step of the policy; lambda grows until there is one."""
        motion, limits = self._motion(state.z), (state.multipliers, state.penalties)
        about = LocalExpansion(self.staged, motion, limits, self.knots, self.evaluator.scale, self._runs(motion))
        self.evaluator.counter.add(Counts.of_slopes(self.staged.tangent_size))
        damping, growth = state.damping, state.growth
        while damping <= MAX_DAMPING:
            policy = about.policy(damping)
            if policy is not None:
                if -policy.first <= self.options.tolerance * (1 + abs(state.value)):
                    return self._settle(state, policy)
                taken = self._search(state, about, policy)
                if taken is not None:
                    softer = damping / growth if taken.length > 0.3 else damping
                    z, damping = taken.motion.z.copy(), max(MIN_DAMPING, softer)
                    after = replace(state, z=z, value=taken.value, damping=damping, growth=2.0)
                    return self._advance(state, after, policy)
            damping, growth = damping * growth, 2 * growth
        return StopReason(Status.STALLED, STALLED)

    def terminate(self, state: IlqrState) -> StopReason | None:
        """Return the reason if the state is stationary, the budget used up, or progress has stalled."""
        if state.settled:
            point = self.evaluator.along(self._motion(state.z))
            return (
                converged(self.evaluator)
                if len(self.staged.lower)
                else stationary(self.evaluator, state.z, point.merit)
            )
        if state.iteration >= self.options.iterations:
            return StopReason(Status.BUDGET, BUDGET)
        return StopReason(Status.STALLED, SLOW) if state.progress.quiet >= (self.options.patience or math.inf) else None

    def resume(self, saved: dict[str, Any]) -> IlqrState:
        """Implement ``Method.resume``."""
        return revive(IlqrState, saved, Progress)

    def _advance(self, before: IlqrState, after: IlqrState, policy: Policy) -> Iteration[IlqrState] | StopReason:
        """Return the state after a step, with its point; start computing the slopes about it."""
        if before.iteration + 1 < self.options.iterations:
            self._runs(self._motion(after.z))
        point = self.evaluator.along(self._motion(after.z))
        if not point.finite:
            return not_finite(point)
        state = replace(after, iteration=before.iteration + 1, progress=before.progress.after(after.value))
        norm = self.evaluator.stationarity(before.z, policy.gradient)
        return self._iteration(point, state, norm, float(np.linalg.norm(after.z - before.z)))

    def _settle(self, state: IlqrState, policy: Policy) -> Iteration[IlqrState] | StopReason:
        """Update the multipliers at a minimum of the augmented objective, or end."""
        point = self.evaluator.along(self._motion(state.z))
        norm = self.evaluator.stationarity(state.z, policy.gradient)
        after = replace(state, iteration=state.iteration + 1, settled=True)
        if not len(self.staged.lower):
            return self._iteration(point, after, norm, 0.0)
        limits = self._limits(self._single(state.z))[0]
        violation = self._beyond(limits, np.zeros_like(limits), np.ones_like(limits))
        largest = float(np.abs(violation).max())
        worst = self.evaluator.problem.violation(point.errors)
        if worst == 0.0 and largest >= VIOLATION_DECREASE * state.violated:
            return self._iteration(point, after, norm, 0.0)
        multipliers = state.penalties * self._beyond(limits, state.multipliers, state.penalties)
        grown = state.penalties * (self.options.growth if largest > VIOLATION_DECREASE * state.violated else 1.0)
        after = replace(after, multipliers=multipliers, penalties=grown, violated=largest, settled=False)
        value = float(self._values(after, self._single(state.z))[0])
        after = replace(after, value=value, progress=Progress(value))
        return self._iteration(point, after, norm, 0.0)

    def _search(self, state: IlqrState, about: LocalExpansion, policy: Policy) -> BestMotion | None:
        """Return the best of the motions of all step lengths; None where none is low enough."""
        best = about.search(policy, lambda motions: self._values(state, motions))
        self.evaluator.counter.add(Counts(rollouts=best.tried))
        if state.value - best.value < MIN_GAIN_RATIO * max(best.expected, 0.0) or best.value >= state.value:
            return None
        self._kept = best.motion
        return best

    def _motion(self, z: Array) -> StagedMotion:
        """Return the motion of z; that of the last step is cached."""
        if self._kept is None or not np.array_equal(self._kept.z, z):
            self._kept = self.staged.roll_out(z, self.evaluator.smoothing)
            self.evaluator.counter.add(Counts(rollouts=1))
        return self._kept

    _kept: StagedMotion | None = None

    def _runs(self, motion: StagedMotion) -> Iterator[Linearized]:
        """Return the slopes of a motion from its end; those of the last motion are cached or in progress."""
        if self._begun is None or self._begun[0] is not motion:
            self._begun = motion, self.staged.linearize_from_end(motion)
        runs, kept = tee(self._begun[1])
        self._begun = motion, kept
        return runs

    _begun: tuple[StagedMotion, Iterator[Linearized]] | None = None

    def _single(self, z: Array) -> MotionBatch:
        motion = self._motion(z)
        return MotionBatch(z[None], motion.x[None], motion.u[None])

    def _limits(self, motions: MotionBatch) -> Array:
        """Return the limits (B, c) of motions."""
        return self.staged.measure(*motions[:3])[1]

    def _values(self, state: IlqrState, motions: MotionBatch) -> Array:
        """Return the augmented objective (B,)."""
        objective, limits = self.staged.measure(*motions[:3])
        beyond = self._beyond(limits, state.multipliers, state.penalties)
        return np.asarray(objective + np.sum(state.penalties * beyond**2, axis=1) / 2)

    def _beyond(self, limits: Array, multipliers: Array, penalties: Array) -> Array:
        """Return the violations of limits that are shifted by their multipliers."""
        moved = limits + multipliers / penalties
        return np.asarray(moved - np.clip(moved, self.staged.lower, self.staged.upper))

    def _iteration(self, point: Point, state: IlqrState, norm: float, step: float) -> Iteration[IlqrState]:
        return Iteration(state, point, norm, step)


def refusal(problem: ShootingProblem) -> str:
    """Return why the solver is not for a problem; empty if it is."""
    return NO_STEPS if problem.staged is None else ""


ILQR = make_solver(
    "ilqr",
    "differential dynamic programming within bounds, for controls over time",
    IlqrOptions,
    stage_of(Ilqr),
    refusal=refusal,
    constraints=True,
    feedback=gains_about,
    by_steps=True,
)
