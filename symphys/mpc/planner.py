"""Plans from measured states: the last plan shifted to the present time, then iterations of iLQR from there."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symphys.codegen import processors
from symphys.errors import Issue, ProblemError, SymphysError
from symphys.mpc.model import horizon_of, receding_model
from symphys.problem import Problem
from symphys.records import dataclass
from symphys.shooting import AffinePolicy, StagedMotion
from symphys.solvers.ddp.forward_pass import MotionBatch, follow_policy
from symphys.solvers.ddp.iteration import LocalExpansion
from symphys.solvers.ddp.knots import PaddedKnots, knot_steps
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.staged_problem import RolloutStages
from symphys.types import Array

FEEDBACK_SHARES = np.array([1.0, 0.5, 0.0])
"""Shares of the feedback with which a shifted plan is simulated; the best is taken, as gains may fail at impacts."""
DAMPING_GROWTH, DAMPING_SHRINK, MAX_DAMPING = 8.0, 0.5, 1e8
"""Factors on the damping after a tick without and with a gain, and its largest value."""


class PlanPolicy(NamedTuple):
    """The decisions of a plan as affine functions of the state.

    Attributes:
        x: (N, nx) states about which it is.
        v: (N, w) decisions there.
        ahead: (N, w) what a whole step adds.
        back: (N, w, n) by the tangent of the state.
    """

    x: Array
    v: Array
    ahead: Array
    back: Array


@dataclass(frozen=True)
class RecedingPlan:
    """A planned motion with feedback.

    Attributes:
        time: [s] when it begins.
        dt: [s] of its steps.
        x: (N + 1, nx) predicted states.
        v: (N, w) decisions: the knots of all control variables, in the file's order.
        back: (N, w, n) gains by the tangent of the state.
        cost: of the objective over the horizon, with the penalty of constraints.
        gained: whether the last iteration lowered it.
    """

    time: float
    dt: float
    x: Array
    v: Array
    back: Array
    cost: float
    gained: bool

    def step(self, time: float) -> int:
        """Return the number of the step at a time [s]."""
        return min(max(math.floor((time - self.time) / self.dt + 1e-9), 0), len(self.v) - 1)


class Planner:
    """One problem over the horizon, whose first state is the measured one.

    Attributes:
        problem: of the file.
        horizon: its [mpc].
        model: the problem over one horizon.
        rollout: of the model.
        tangent: of its states.
        p: (np,) its parameters.
        weights: (m, w): inputs of a step are weights @ v.
        lower, upper, scale: (w,) of the decisions.
        damping: of the next iteration.
        threads: their number for the steps of a plan.
        description: of the evaluator.
    """

    def __init__(self, problem: Problem, threads: int | None = None) -> None:
        """Compile the model; ProblemError if the problem has no receding horizon."""
        self.problem, self.horizon = problem, horizon_of(problem)
        self.model = receding_model(problem)
        self.rollout = symbolic_rollout(self.model)
        exact = self.horizon.smoothing == 0
        try:
            self.stages = RolloutStages(self.rollout, threads=threads, exact=exact, priced=True)
        except SymphysError as error:  # of a formula whose sizes do not fit
            text = f"{error}; in a plan the name of a variable is its value at one instant"
            raise ProblemError(problem.file, [Issue("mpc", text)]) from None
        self.tangent = self.stages.tangent
        guess, lower, upper, self._scale = (
            np.concatenate([getattr(each, key) for each in self.model.variables])
            for key in ("guess", "lower", "upper", "scale")
        )
        self._knots, self._z = PaddedKnots.of(knot_steps(self.stages), lower, upper), guess
        assert self._knots.steps.aligned, "each control has a knot a step"
        self._new, self.weights = self._knots.new, self._knots.weights[0]
        self.lower, self.upper, self.scale = (each[self._new[0]] for each in (lower, upper, self._scale))
        Z = guess[None]
        self.start: Array = self.stages.start(Z)[0]
        self.p: Array = self.stages.parameters(Z)[0]
        self._limits = np.zeros(len(self.stages.lower)), 2 * self.stages.penalties
        self.description = self.stages.description
        self.damping = self.horizon.damping
        self.threads = processors() if threads is None else threads

    def first(self, x: Array, time: float) -> RecedingPlan:
        """Return a plan from the guess, after the iterations before the first tick."""
        self.damping = self.horizon.damping
        guess = self._z[self._new]
        gains = np.zeros((*guess.shape, self.tangent.size))
        policy = PlanPolicy(np.tile(x, (len(guess), 1)), guess, np.zeros_like(guess), gains)
        return self._improved(policy, x, time, self.horizon.first_iterations)

    def next(self, plan: RecedingPlan, x: Array, time: float) -> RecedingPlan:
        """Return the plan from a measured state (nx,) at a time [s]: the last plan shifted and improved."""
        return self._improved(shifted(plan, time), x, time, self.horizon.iterations)

    def follow(
        self, x: Array, policy: PlanPolicy, lengths: Array, time: float, shares: Array | float = 1.0
    ) -> tuple[Array, Array, Array]:
        """Simulate from a state (nx,) at a time [s]: states (B, N + 1, nx), decisions (B, N, w), costs (B,).

        ``lengths``, ``shares``: (B,) of the steps and of the feedback.
        """
        # Simulate the policy from the measured state, then evaluate the objective.
        self.stages.begin(x, time)
        knots, z = self._knots, np.repeat(self._z[None], len(lengths), axis=0)
        none, bounds = np.zeros(knots.old.shape), knots.bounds
        about = AffinePolicy(policy.x, none, *policy[1:], knots.weights, knots.keep, *bounds)
        states, inputs, new, merit = follow_policy(
            self.stages, about, self._z, z, lengths, self.horizon.smoothing, shares
        )
        z[:, self._new] = new
        return states, new, self._costs(MotionBatch(z, states, inputs, merit))

    def _improved(self, policy: PlanPolicy, x: Array, time: float, iterations: int) -> RecedingPlan:
        """Simulate the policy from the state, then iterate."""
        none = np.zeros(len(FEEDBACK_SHARES))
        states, decisions, costs = self.follow(x, policy, none, time, FEEDBACK_SHARES)
        best = int(np.where(np.isfinite(costs), costs, math.inf).argmin())
        plan = RecedingPlan(
            time, self.horizon.dt, states[best], decisions[best], policy.back, float(costs[best]), False
        )
        for _ in range(iterations):
            plan = self._iterate(plan)
            if self.damping >= MAX_DAMPING:
                break
        return plan

    def _iterate(self, plan: RecedingPlan) -> RecedingPlan:
        """Make one iteration of iLQR; without a gain, keep the plan with gains about it and more damping."""
        # Expand about the plan, compute the policy, and search along it.
        about = LocalExpansion(self.stages, self._motion(plan), self._limits, self._knots, self._scale)
        policy = about.policy(self.damping, gradient=False)
        if policy is not None and all(np.isfinite(each).all() for each in (policy.ahead, policy.back)):
            best, back = about.search(policy, self._costs), policy.back
            if best.value < plan.cost:
                self.damping = max(self.horizon.damping, self.damping * DAMPING_SHRINK)
                decisions = best.motion.z[self._new]
                return RecedingPlan(plan.time, plan.dt, best.motion.x, decisions, back, best.value, True)
            plan = replace(plan, back=back)
        self.damping = min(self.damping * DAMPING_GROWTH, MAX_DAMPING)
        return replace(plan, gained=False)

    def _motion(self, plan: RecedingPlan) -> StagedMotion:
        """Return the motion of a plan."""
        self.stages.begin(plan.x[0], plan.time)
        z = self._z.copy()
        z[self._new] = plan.v
        u = plan.v @ self.weights.T
        return StagedMotion(z, plan.x, u, self.horizon.smoothing, gapless=True)

    def _costs(self, motions: MotionBatch) -> Array:
        """Return the objective (B,) with the penalty of constraints."""
        if motions.merit is not None:
            return motions.merit
        stages = self.stages
        objective, limits = stages.measure(*motions[:3])
        beyond = limits - np.clip(limits, stages.lower, stages.upper)
        return np.asarray(objective + np.sum(stages.penalties * beyond**2, axis=1))


def shifted(plan: RecedingPlan, time: float) -> PlanPolicy:
    """Return a plan from a later time [s] on: linear between its steps, constant after its end.

    States between two steps are means of both; they are only what feedback refers to.
    """
    passed = max(time - plan.time, 0.0) / plan.dt
    whole = math.floor(passed)
    share = passed - whole
    last = len(plan.v) - 1
    here = np.minimum(np.arange(last + 1) + whole, last)
    there = np.minimum(here + 1, last)
    x = (1 - share) * plan.x[here] + share * plan.x[here + 1]
    v = (1 - share) * plan.v[here] + share * plan.v[there]
    return PlanPolicy(x, v, np.zeros_like(v), plan.back[here])
