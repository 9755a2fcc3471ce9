"""Costs, targets and constraints along a rollout: the objective, its residuals, and the errors it is judged by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np

from symphys.expression import Formula
from symphys.maths.smoothing import length
from symphys.problem import Constraint, Cost, Phase, Problem, Target
from symphys.types import Expr


class Sampled(Protocol):
    """A rollout that can be asked for the values of formulas along it; see ``Rollout``."""

    @property
    def problem(self) -> Problem:
        """What is rolled out."""

    @property
    def steps(self) -> int:
        """N."""

    @property
    def interval(self) -> Expr:
        """[s] the time step: a number, or an expression of z where a variable sets the duration."""

    def at(self, formula: Formula, when: str | float) -> Expr:
        """(m,) at the end or at a time."""

    def after_steps(self, formula: Formula) -> Expr:
        """(m, N) at the end of every step."""

    def over_steps(self, formula: Formula) -> Expr:
        """(m, N or 2N) samples whose mean is the time average."""

    def sums(self, samples: Expr, scale: Any = None) -> tuple[Expr, Expr]:
        """(m,) the sum of the columns; the sum of the squares of scale times each number, None without a scale."""


@dataclass(frozen=True)
class Terms:
    """Everything that a problem asks of a rollout, as expressions of z.

    Attributes:
        costs: (k,) weighted cost of each [[cost]].
        objective: scalar: costs and weighted squares of targets.
        residuals: (m,) with objective + penalties = r . r; None where a cost is no sum of squares.
        penalties: scalar: quadratic penalties of violated constraints.
        errors: (e,) error / tolerance of each target, constraint and the goal: met where <= 1.
        constraints: (c,) values, with ``lower`` and ``upper`` (c,) as numbers and ``names`` one an entry.
        outputs: (o,) as reported.
        means: (a,) the value of every formula, its mean over time where it is evaluated always: what is differentiated
            to examine a gradient, since it means the same on any time grid and its slope does not vanish at a solution.
    """

    costs: Expr
    objective: Expr
    residuals: Expr | None
    penalties: Expr
    errors: Expr
    constraints: Expr
    lower: np.ndarray[Any, np.dtype[np.float64]]
    upper: np.ndarray[Any, np.dtype[np.float64]]
    names: tuple[str, ...]
    outputs: Expr
    means: Expr


def terms(rollout: Sampled) -> Terms:
    """The terms of the rollout's problem."""
    problem = rollout.problem
    costs = [_cost(rollout, cost) for cost in problem.costs]
    targets = [(target, rollout.at(target.formula, target.at)) for target in problem.targets]
    limits = [_Limit(rollout, constraint) for constraint in problem.constraints]
    residuals = [np.sqrt(target.weight) * value for target, value in targets]
    objective = sum((cost.value for cost in costs), ca.MX(0)) + sum(
        (ca.sumsqr(residual) for residual in residuals), ca.MX(0)
    )
    errors = [_miss(target, value) for target, value in targets] + [limit.error for limit in limits]
    if problem.goal is not None:
        errors.append(goal_error(objective, problem.goal))
    squares = [cost.residual for cost in costs]
    penalties = [limit.penalty for limit in limits]
    whole = None if any(r is None for r in squares) else _stack([*squares, *residuals, *penalties])
    return Terms(
        costs=_stack([cost.value for cost in costs]),
        objective=objective,
        residuals=whole,
        penalties=sum((ca.sumsqr(penalty) for penalty in penalties), ca.MX(0)),
        errors=_stack(errors),
        constraints=_stack([limit.value for limit in limits]),
        lower=np.concatenate([limit.lower for limit in limits] or [np.zeros(0)]),
        upper=np.concatenate([limit.upper for limit in limits] or [np.zeros(0)]),
        names=tuple(limit.name for limit in limits for _ in range(limit.lower.size)),
        outputs=_stack([rollout.at(output.formula, output.at) for output in problem.outputs]),
        means=_stack(
            [cost.mean for cost in costs] + [value for _, value in targets] + [limit.mean for limit in limits]
        ),
    )


def has_squares(problem: Problem) -> bool:
    """Whether ``Terms.residuals`` are more than none."""
    return all(cost.squares for cost in problem.costs) and bool(problem.costs or problem.targets or problem.constraints)


Bounds = tuple[tuple[str, ...], np.ndarray[Any, np.dtype[np.float64]], np.ndarray[Any, np.dtype[np.float64]]]


def bounds(problem: Problem, size_of: Callable[[Formula], int]) -> Bounds:
    """Names, lower and upper bounds of ``Terms``, without its expressions; ``size_of`` formulas."""
    names, lower, upper = list[str](), [np.zeros(0)], [np.zeros(0)]
    steps = problem.simulation.steps
    for constraint in problem.constraints:
        size = size_of(constraint.formula)
        count = 1
        if constraint.at == "always":
            first, last = (0, steps) if constraint.during is None else constraint.during.ticks(steps)
            count = last - first
        low, high = _bounds(constraint, size, count)
        names += [constraint.name] * low.size
        lower.append(low)
        upper.append(high)
    return tuple(names), np.concatenate(lower), np.concatenate(upper)


def _bounds(constraint: Constraint, size: int, count: int) -> Any:
    """(size count,) each, of so many values of a constraint."""
    return (np.tile(np.broadcast_to(bound, (size,)), count) for bound in (constraint.lower, constraint.upper))


def goal_error(objective: Any, goal: float) -> Any:
    """Error / tolerance of a goal for the objective: 1 at the goal, below it where the objective is lower."""
    return 1 + (objective - goal) / max(abs(goal), 1e-9)


def limits(problem: Problem) -> range:
    """Which of the errors are those of constraints."""
    return range(len(problem.targets), len(problem.targets) + len(problem.constraints))


def _stack(parts: list[Expr]) -> Expr:
    return ca.vertcat(ca.MX(0, 1), *(ca.vec(part) for part in parts))


def plain_sums(samples: Expr, scale: Any = None) -> tuple[Expr, Expr]:
    """See ``Sampled.sums``."""
    return ca.sum2(samples), None if scale is None else ca.sumsqr(scale * ca.vec(samples))


def _mean(samples: Expr) -> Expr:
    """(m,): the mean of the columns."""
    return ca.sum2(samples) / samples.shape[1]


def within(samples: Expr, phase: Phase | None, steps: int) -> tuple[Expr, int]:
    """The columns of a phase, of N or 2N as ``Sampled.over_steps`` gives them, and how many steps it has."""
    if phase is None:
        return samples, steps
    first, last = phase.ticks(steps)
    parts = [samples[:, start + first : start + last] for start in range(0, samples.shape[1], steps)]
    return ca.horzcat(*parts), last - first


class _Cost(NamedTuple):
    """A weighted cost, the residuals whose squares sum to it (or None), the mean of its formula."""

    value: Expr
    residual: Expr | None
    mean: Expr


def _cost(rollout: Sampled, cost: Cost) -> _Cost:
    if cost.at == "always":
        samples, steps = within(rollout.over_steps(cost.formula), cost.during, rollout.steps)
        weight = cost.weight * rollout.interval * steps / samples.shape[1]
    else:
        samples, weight = rollout.at(cost.formula, cost.at), cost.weight
    scale = ca.sqrt(weight) if cost.squares else None
    total, squares = rollout.sums(samples, scale)
    mean = total / samples.shape[1]
    if scale is None:
        return _Cost(weight * total, None, mean)
    return _Cost(squares, scale * ca.vec(samples), mean)


def _miss(target: Target, value: Expr) -> Expr:
    return length(value) / target.tolerance


class _Limit:
    """One constraint: its values and their mean, bounds, penalty residuals and error."""

    def __init__(self, rollout: Sampled, constraint: Constraint) -> None:
        always = constraint.at == "always"
        if always:
            values, _ = within(rollout.after_steps(constraint.formula), constraint.during, rollout.steps)
        else:
            values = rollout.at(constraint.formula, constraint.at)
        count = values.shape[1]
        self.name = constraint.name
        self.value, self.mean = ca.vec(values), _mean(values)
        size = values.shape[0]
        self.lower, self.upper = _bounds(constraint, size, count)
        violation = self._violation()
        self.penalty = ca.sqrt(constraint.penalty * (rollout.interval if always else 1.0)) * violation
        total: Expr = ca.sum1(violation)
        self.error = ca.if_else(total >= 0, ca.mmax(violation), total) / constraint.tolerance  # mmax hides a NaN

    def _violation(self) -> Expr:
        """(c,) >= 0: how far each value lies outside its bounds."""
        total = ca.MX.zeros(self.value.shape[0])
        for bound, sign in ((self.lower, -1), (self.upper, 1)):
            finite = np.isfinite(bound)
            beyond = sign * (self.value - ca.DM(np.where(finite, bound, 0.0)))
            total += ca.DM(finite.astype(float)) * (beyond + ca.fabs(beyond)) / 2  # fmax(beyond, 0) hides a NaN
        return total
