"""Costs, targets and constraints along a rollout: the objective, its residuals, and the judged errors.

``terms`` evaluates those of ``symphys.transcription.terms`` along a whole motion, of the symbols of ``FormulaSamples``.
Casadi's virtual machine puts expressions of a rollout in their place, a kernel the places of its vector, and rollouts
with large nets put arrays there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from symphys.expression import Formula, MotionPart
from symphys.maths.smoothing import length
from symphys.problem import Constraint, Problem
from symphys.records import dataclass
from symphys.transcription.rollout import Rollout
from symphys.transcription.terms import EvaluationPoints, Term, instant, part_points, problem_terms
from symphys.types import Array, Expr

MIN_SEPARATE_SUM = 512
"""Least number of terms of a sum that may be computed outside the function of all terms."""
Series = tuple[Formula, int]
"""A formula at the starts (0) or ends (1) of all steps."""
Total = tuple[tuple[Series, ...], float | None]
"""Series, and the scale of their summed squares; None without squares."""
Sums = Callable[[float | None], tuple[Expr, Expr | None]]


class FormulaSamples:
    """The samples of formulas along a rollout as symbols (MX), for which evaluators substitute values.

    Attributes:
        z: (n,) decision vector.
        p: (np,) parameters.
        moments: states (nx,) and inputs (nu,) by the numbers of the state and of the step, in the order of requests.
        series: (m, N) values of a formula at the starts (0) or ends (1) of all steps, likewise.
        totals: (m,) or (m + 1,) sums over whole series, see ``Total``; there are none unless they are ``separate``.
    """

    def __init__(self, rollout: Rollout, separate: bool = False) -> None:
        """Start without requests.

        Args:
            rollout: of the problem.
            separate: whether long sums are symbols too, so that they need not be part of one function.
        """
        self.rollout, self.problem, self.steps, self._separate = rollout, rollout.problem, rollout.steps, separate
        self.z, self.p = ca.MX.sym("z", rollout.z.shape[0]), ca.MX.sym("p", rollout.p.shape[0])
        self.interval = rollout.parameters.step_length(self.problem.simulation, self.p)
        self.moments: dict[tuple[int, int], tuple[Expr, Expr]] = {}
        self.series: dict[Series, Expr] = {}
        self.totals: dict[Total, Expr] = {}

    @property
    def symbols(self) -> list[Expr]:
        """All symbols: z, p, moments, series and totals."""
        moments = [symbol for pair in self.moments.values() for symbol in pair]
        return [self.z, self.p, *moments, *self.series.values(), *self.totals.values()]

    def at(self, formula: Formula, point: EvaluationPoints) -> Expr:
        """Return the value (m,) of a formula at one instant."""
        (key,) = point.pairs
        k, _ = key
        if key not in self.moments:
            x0, given = self.rollout.x0, self.rollout.given
            self.moments[key] = ca.MX.sym("x", x0.shape[0]), ca.MX.sym("u", given.shape[0])
        x, u = self.moments[key]
        parts = [ca.vertcat(*(self._part(part) for part in formula.parts))] if formula.parts else []
        return self.rollout.compiled(formula)(x, u, self.p, k * self.interval, self.z, *parts)

    def _part(self, part: MotionPart) -> Expr:
        """Return the value (m,) of a part over the whole motion; integrals follow the rule of running costs."""
        points = part_points(self.rollout, part)
        if part.kind in ("start", "end"):
            return self.at(part.formula, points)
        average = _mean(ca.horzcat(*(self.values((part.formula, side)) for side in points.sides)))
        return average if part.kind == "average" else self.interval * self.steps * average

    def values(self, series: Series) -> Expr:
        """Return the values (m, N) of a series."""
        size = int(self.rollout.compiled(series[0]).size1_out(0))
        return self.series.setdefault(series, ca.MX.sym("series", size, self.steps))

    def sums(self, series: tuple[Series, ...], scale: float | None) -> tuple[Expr, Expr | None]:
        """Return the sum (m,) of the columns, and with a scale the sum of the scaled squares."""
        samples = ca.horzcat(*map(self.values, series))
        if not self._separate or samples.numel() < MIN_SEPARATE_SUM:
            return plain_sums(samples, scale)
        rows = int(samples.shape[0])
        total = self.totals.setdefault((series, scale), ca.MX.sym("total", rows + (scale is not None)))
        return total[:rows], None if scale is None else total[rows]


@dataclass(frozen=True)
class Terms:
    """Objective, residuals, constraints and outputs of a problem as expressions of z.

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
    lower: Array
    upper: Array
    names: tuple[str, ...]
    outputs: Expr
    means: Expr


def rollout_terms(rollout: Rollout, motion: tuple[Expr, Expr] | None = None) -> Terms:
    """Return the terms of a rollout as expressions of its z and smoothing.

    ``motion``: other states (nx, N + 1) and inputs (nu, N), of which and of z they are expressions then.
    """
    samples = FormulaSamples(rollout)
    asked = terms(samples)
    x, u = (rollout.x, rollout.u) if motion is None else motion
    moments = [part for k, step in samples.moments for part in (x[:, k], u[:, step])]
    series = [rollout.sampled_along(*each, x, u, rollout.p, rollout.z) for each in samples.series]
    parts = {name: part for name, part in vars(asked).items() if isinstance(part, ca.MX)}
    function = ca.Function("terms", samples.symbols, list(parts.values()))
    found = function.call([rollout.z, rollout.p, *moments, *series], True, False)
    return replace(asked, **dict(zip(parts, found, strict=True)))


def terms(samples: FormulaSamples) -> Terms:
    """Return the terms of a problem as expressions of the symbols of its samples."""
    problem = samples.problem
    # Evaluate all formulas.
    asked = problem_terms(samples.rollout)
    first, last = len(problem.costs), len(problem.costs) + len(problem.targets)
    costs = [_cost(samples, term) for term in asked[:first]]
    targets = [samples.at(term.formula, term.points) for term in asked[first:last]]
    limits = [_Limit(samples, term) for term in asked[last:]]
    # Objective = costs + squared residuals of targets; penalties are squared violations.
    residuals = [np.sqrt(term.weight) * value for term, value in zip(asked[first:last], targets, strict=True)]
    objective = sum((cost.value for cost in costs), ca.MX(0)) + sum(
        (ca.sumsqr(residual) for residual in residuals), ca.MX(0)
    )
    errors = [length(value) / target.tolerance for target, value in zip(problem.targets, targets, strict=True)]
    errors += [limit.error for limit in limits]
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
        outputs=_stack([samples.at(each.formula, instant(samples.rollout, each.at)) for each in problem.outputs]),
        means=_stack([cost.mean for cost in costs] + targets + [limit.mean for limit in limits]),
    )


def has_squares(problem: Problem) -> bool:
    """Whether ``Terms.residuals`` has any entries."""
    return all(cost.squares for cost in problem.costs) and bool(problem.costs or problem.targets or problem.constraints)


def bounds(rollout: Rollout) -> tuple[tuple[str, ...], Array, Array]:
    """Return names, lower and upper bounds of ``Terms``, without its expressions."""
    names, lower, upper = list[str](), [np.zeros(0)], [np.zeros(0)]
    for term in problem_terms(rollout):
        if term.kind == "limit":
            low, high = term.bounds(int(rollout.compiled(term.formula).size1_out(0)))
            names += [term.table.name] * low.size
            lower.append(low)
            upper.append(high)
    return tuple(names), np.concatenate(lower), np.concatenate(upper)


def goal_error(objective: Any, goal: float) -> Any:
    """Return error / tolerance of a goal for the objective: 1 at the goal, less below it."""
    return 1 + (objective - goal) / max(abs(goal), 1e-9)


def limits(problem: Problem) -> range:
    """Return which entries of ``Terms.errors`` belong to constraints."""
    return range(len(problem.targets), len(problem.targets) + len(problem.constraints))


def _stack(parts: list[Expr]) -> Expr:
    return ca.vertcat(ca.MX(0, 1), *(ca.vec(part) for part in parts))


def plain_sums(samples: Expr, scale: Any = None) -> tuple[Expr, Expr | None]:
    """Return the sum of the columns, and that of the scaled squares."""
    return ca.sum2(samples), None if scale is None else ca.sumsqr(scale * ca.vec(samples))


def _mean(samples: Expr) -> Expr:
    """Return the mean (m,) of the columns."""
    return ca.sum2(samples) / samples.shape[1]


def _over_time(samples: FormulaSamples, term: Term) -> Expr:
    """Return the values (m, evaluations) of a running term."""
    series = [samples.values((term.formula, side)) for side in term.points.sides]
    steps = term.points.steps
    return ca.horzcat(*(each if len(steps) == samples.steps else each[:, steps.start : steps.stop] for each in series))


class _Cost(NamedTuple):
    """A weighted cost, the residuals whose squares sum to it (or None), the mean of its formula."""

    value: Expr
    residual: Expr | None
    mean: Expr


def _cost(samples: FormulaSamples, term: Term) -> _Cost:
    if not term.running:
        return _weighed(term, samples.at(term.formula, term.points), term.weight)
    values, steps = _over_time(samples, term), len(term.points.steps)
    weight = term.weight * samples.interval * steps / values.shape[1]
    series = tuple((term.formula, side) for side in term.points.sides)
    whole = steps == samples.steps and not (term.kind == "squares" and samples.problem.free_duration)
    return _weighed(term, values, weight, (lambda scale: samples.sums(series, scale)) if whole else None)


def _weighed(term: Term, values: Expr, weight: Any, sums: Sums | None = None) -> _Cost:
    """Return a cost of values (m, samples); ``sums`` computes sums by scale outside this function."""
    scale = ca.sqrt(weight) if term.kind == "squares" else None
    total, squares = plain_sums(values, scale) if sums is None else sums(scale)
    mean = total / values.shape[1]
    if scale is None:
        return _Cost(weight * total, None, mean)
    return _Cost(squares, scale * ca.vec(values), mean)


class _Limit:
    """One constraint: its values and their mean, bounds, penalty residuals and error."""

    def __init__(self, samples: FormulaSamples, term: Term) -> None:
        table = term.table
        assert isinstance(table, Constraint)
        values = _over_time(samples, term) if term.running else samples.at(term.formula, term.points)
        self.name = table.name
        self.value, self.mean = ca.vec(values), _mean(values)
        self.lower, self.upper = term.bounds(int(values.shape[0]))
        violation = self._violation()
        self.penalty = ca.sqrt(term.weight * (samples.interval if term.running else 1.0)) * violation
        total: Expr = ca.sum1(violation)
        self.error = ca.if_else(total >= 0, ca.mmax(violation), total) / table.tolerance  # mmax hides a NaN

    def _violation(self) -> Expr:
        """Return (c,) >= 0: the distance of each value from its bounds."""
        total = ca.MX.zeros(self.value.shape[0])
        for bound, sign in ((self.lower, -1), (self.upper, 1)):
            finite = np.isfinite(bound)
            beyond = sign * (self.value - ca.DM(np.where(finite, bound, 0.0)))
            total += ca.DM(finite.astype(float)) * (beyond + ca.fabs(beyond)) / 2  # fmax(beyond, 0) hides a NaN
        return total
