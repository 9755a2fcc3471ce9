"""Plans from measured states: the last plan shifted to now, then iterations of iLQR from there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen import processors
from symphys.errors import Issue, ProblemError, SymphysError
from symphys.mpc.horizon_costs import HorizonCosts, QuadraticCosts
from symphys.mpc.model import horizon_of, receding_model
from symphys.problem import Problem
from symphys.shooting import AffinePolicy
from symphys.solvers.ddp.riccati import CostToGo, LinearStep, riccati_recursion
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.transcription.staged.linearized_step import LinearizedStep
from symphys.transcription.staged.policy_rollout import PolicyRollout, PolicySizes
from symphys.transcription.staged.stage_terms import StageSymbols, motion_sums, stage_terms
from symphys.transcription.staged.tangent import Tangent
from symphys.types import Array

LENGTHS = 0.5 ** np.arange(8.0)
"""Step lengths that are tried side by side."""
SHARES = np.array([1.0, 0.5, 0.0])
"""Of the feedback with which a shifted plan is followed: the cheapest counts. Gains may fail across an impact."""
GROWTH, SHRINK, STIFFEST = 8.0, 0.5, 1e8
"""Factors on the damping after a tick that gained nothing and after one that did, and its largest value."""


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
    """What a controller intends.

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
        """The number of the step that holds at a time [s]."""
        return min(max(math.floor((time - self.time) / self.dt + 1e-9), 0), len(self.v) - 1)


class Planner:
    """One problem over the horizon, whose first state is what the plant measures.

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
        threads: that share the steps of a plan.
        description: what evaluates, in words.
    """

    def __init__(self, problem: Problem, threads: int | None = None) -> None:
        """Compile the model; ProblemError where a receding horizon makes no sense for the problem."""
        self.problem, self.horizon = problem, horizon_of(problem)
        self.model = receding_model(problem)
        self.rollout = symbolic_rollout(self.model)
        self.tangent = Tangent(self.rollout)
        symbols = StageSymbols(self.rollout, self.tangent, motion_sums(self.rollout))
        self._step = LinearizedStep(
            self.rollout, self.tangent, threads=threads, exact=self.horizon.smoothing == 0, parameters=False
        )
        self._order = decision_order(self.model)
        stacked = {
            key: np.concatenate([getattr(each, key) for each in self.model.variables])[self._order]
            for key in ("guess", "lower", "upper", "scale")
        }
        self._guess = stacked["guess"]
        self.lower, self.upper, self.scale = (stacked[key][0] for key in ("lower", "upper", "scale"))
        self.start, self.p, self.weights = begun(self.rollout, self._order)
        try:
            terms = stage_terms(symbols)
        except SymphysError as error:  # of a formula whose sizes do not fit
            text = f"{error}; in a plan the name of a variable is its value at one instant"
            raise ProblemError(problem.file, [Issue("mpc", text)]) from None
        self._costs = HorizonCosts(symbols, self.tangent, terms, self.weights)
        steps, (inputs, width) = self.rollout.steps, self.weights.shape
        self._rolled = PolicyRollout(self._step, PolicySizes(0, width, inputs), self._costs)
        self._bounds = np.tile(self.lower, (steps, 1)), np.tile(self.upper, (steps, 1))
        self._same = np.tile(self.weights, (steps, 1, 1)), np.zeros((steps, 0, width))
        self.description = self._step.description
        self._whole_inputs = not np.array_equal(self.weights, np.eye(len(self.weights)))
        self.damping = self.horizon.damping
        self.threads = processors() if threads is None else threads

    def first(self, x: Array, time: float) -> RecedingPlan:
        """A plan from the guess, after the iterations that come before the first tick."""
        self.damping = self.horizon.damping
        steps, zeros = self.rollout.steps, np.zeros_like(self._guess)
        gains = np.zeros((*zeros.shape, self.tangent.size))
        policy = PlanPolicy(np.tile(x, (steps, 1)), self._guess, zeros, gains)
        return self._improved(policy, x, time, self.horizon.first_iterations)

    def next(self, plan: RecedingPlan, x: Array, time: float) -> RecedingPlan:
        """The plan from a measured state (nx,) at a time [s]: the last one shifted to then, and improved."""
        return self._improved(shifted(plan, time), x, time, self.horizon.iterations)

    def follow(
        self, x: Array, policy: PlanPolicy, lengths: Array, time: float, shares: Array | float = 1.0
    ) -> tuple[Array, Array, Array]:
        """From a state (nx,) at a time [s]: states (B, N + 1, nx), decisions (B, N, w) and costs (B,).

        ``lengths``, ``shares``: (B,) of the steps and of the feedback.
        """
        none = np.zeros((len(policy.v), 0))
        about = AffinePolicy(policy.x, none, *policy[1:], *self._same, *self._bounds)
        found = self._rolled(x, self.p, about, lengths, self.horizon.smoothing, time, shares=shares)
        return found.x, found.new, found.cost

    def _improved(self, policy: PlanPolicy, x: Array, time: float, iterations: int) -> RecedingPlan:
        """Follow the policy from the state, then iterate."""
        none = np.zeros(len(SHARES))
        states, decisions, costs = self.follow(x, policy, none, time, SHARES)
        best = int(np.where(np.isfinite(costs), costs, math.inf).argmin())
        plan = RecedingPlan(
            time, self.horizon.dt, states[best], decisions[best], policy.back, float(costs[best]), False
        )
        for _ in range(iterations):
            plan = self._iterate(plan)
            if self.damping >= STIFFEST:
                break
        return plan

    def _iterate(self, plan: RecedingPlan) -> RecedingPlan:
        """One iteration of iLQR: slopes, costs, backward pass, and the best of the motions of all step lengths.

        The backward pass begins while threads are at the slopes of earlier steps.
        """
        self._step.clock = plan.time
        u = plan.v @ self.weights.T if self._whole_inputs else plan.v
        runs = self._step.slopes_from_end(plan.x[:-1], u, self.p, self.horizon.smoothing, plan.x[1:])
        costs = self._costs.expand(plan.x, plan.v, self.p, plan.time)
        slopes = ((a, b @ self.weights if self._whole_inputs else b) for a, b, _ in runs)
        room = self.lower - plan.v, self.upper - plan.v
        found = plan_feedback(slopes, costs, room, self.damping / self.scale**2)
        if found is None:
            return self._kept(plan, plan.back)
        ahead, back = found
        about = PlanPolicy(plan.x[:-1], plan.v, ahead, back)
        states, decisions, values = self.follow(plan.x[0], about, LENGTHS, plan.time)
        values = np.where(np.isfinite(values), values, math.inf)
        best = int(values.argmin())
        if not values[best] < plan.cost:
            return self._kept(plan, back)
        self.damping = max(self.horizon.damping, self.damping * SHRINK)
        return RecedingPlan(plan.time, plan.dt, states[best], decisions[best], back, float(values[best]), True)

    def _kept(self, plan: RecedingPlan, back: Array) -> RecedingPlan:
        """The plan as it was, with gains about it; the next iteration is more careful."""
        self.damping = min(self.damping * GROWTH, STIFFEST)
        return replace(plan, back=back, gained=False)


def plan_feedback(
    slopes: Iterable[tuple[Array, Array]], costs: QuadraticCosts, room: tuple[Array, Array], damping: Array
) -> tuple[Array, Array] | None:
    """Feedforward (N, w) and gains (N, w, n); None where a Hessian is not positive definite, or slopes not finite.

    Args:
        slopes: (K, n, n) and (K, n, w) the next states by the states and by the decisions, of runs of K steps; the last
            run first.
        costs: about the motion.
        room: (N, w) each, how far decisions may go down and up.
        damping: (w,) added to the diagonal of the Hessian by decisions.
    """
    n = costs.slope.shape[1] - len(damping)
    last = CostToGo(costs.slope[-1, :n], costs.curve[-1, :n, :n])
    found = riccati_recursion(_from_end(slopes, costs, room, damping), last)
    if found is None:
        return None
    feedback = [each for each in reversed(found.feedback) if each is not None]
    ahead, back = np.array([each.ahead for each in feedback]), np.array([each.back for each in feedback])
    return (ahead, back) if np.isfinite(ahead).all() and np.isfinite(back).all() else None


def _from_end(
    slopes: Iterable[tuple[Array, Array]], costs: QuadraticCosts, room: tuple[Array, Array], damping: Array
) -> Iterator[LinearStep]:
    """The steps for the recursion, the last one first; see ``plan_feedback``."""
    end = len(costs.slope) - 1
    for a, b in slopes:
        n, first = a.shape[1], end - len(a)
        through, curves = np.concatenate([a, b], axis=2), costs.curve[first:end]
        if costs.ahead is not None:
            curves, later = curves.copy(), costs.ahead[first:end] @ through
            curves[:, n:] += later
            curves[:, :, n:] += later.transpose(0, 2, 1)
        parts = through, costs.slope[first:end], curves, *(each[first:end] for each in room)
        for t, q, c, low, high in zip(*(part[::-1] for part in parts), strict=True):
            yield LinearStep(t, q, c, low, high, damping)
        end = first


def decision_order(model: Problem) -> NDArray[np.int64]:
    """(N, w): where the decisions of each step lie in z; variable after variable, as in the file."""
    steps, first, columns = model.simulation.steps, 0, list[NDArray[np.int64]]()
    for variable in model.variables:
        columns.append(first + np.arange(variable.guess.size).reshape(steps, -1))
        first += variable.guess.size
    return np.concatenate(columns, axis=1)


def begun(rollout: Rollout, order: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """First state (nx,), parameters (np,), and how the inputs of a step follow from its decisions (m, w)."""
    slope = ca.jacobian(rollout.given[:, 0], rollout.z)
    made = ca.Function("begun", [rollout.z], [ca.densify(each) for each in (rollout.x0, rollout.p, slope)])
    x, p, weights = (np.array(part) for part in made.call([np.zeros(rollout.z.shape[0])]))
    return x.ravel(), p.ravel(), weights[:, order[0]]


def shifted(plan: RecedingPlan, time: float) -> PlanPolicy:
    """What a plan says from a later time [s] on, step by step: between its steps linearly, after its end as last.

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
