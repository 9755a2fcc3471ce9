"""What a problem asks of a motion: the formulas of its tables, where along the motion, and how each counts.

It is said here alone. ``objective`` evaluates it along whole motions, ``staged/stage_terms`` step by step, and
``nan_tracing`` looks there for the first number that is not finite.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from symphys.expression import Formula, MotionPart
from symphys.problem import Constraint, Cost, Phase, Target
from symphys.records import dataclass
from symphys.transcription.rollout import Rollout
from symphys.types import Array


@dataclass(frozen=True)
class EvaluationPoints:
    """The steps of a motion in which a formula is evaluated, with the inputs of each.

    Attributes:
        steps: their numbers.
        sides: which states of a step are looked at: 0 that before it, 1 that after it. Of both the mean counts.
    """

    steps: range
    sides: tuple[int, ...]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Return (number of the state, number of the step) of all evaluations."""
        return [(k + side, k) for side in self.sides for k in self.steps]


def instant(rollout: Rollout, when: str | float) -> EvaluationPoints:
    """Return the state at the end or nearest to a time [s]; the last state belongs to the last step."""
    tick = rollout.tick(when)
    step = min(tick, rollout.steps - 1)
    return EvaluationPoints(range(step, step + 1), (tick - step,))


def over_time(rollout: Rollout, formula: Formula, phase: Phase | None = None) -> EvaluationPoints:
    """Return where the mean over a motion or a phase is taken: by the trapezoidal rule of what changes in a step."""
    steps = range(*((0, rollout.steps) if phase is None else phase.ticks(rollout.steps)))
    return EvaluationPoints(steps, (0, 1) if rollout.moves(formula) else (0,))


def part_points(rollout: Rollout, part: MotionPart) -> EvaluationPoints:
    """Return where the formula of a part is evaluated."""
    if part.kind in ("start", "end"):
        return instant(rollout, 0.0 if part.kind == "start" else "end")
    return over_time(rollout, part.formula)


@dataclass(frozen=True)
class Term:
    """A cost, a target or a constraint.

    Attributes:
        table: that it is from.
        kind: ``cost``: its values are summed; ``squares``: their squares are; ``limit``: they lie within bounds.
        weight: factor of the sum; of a limit, of its squared violations, each value's.
        points: where it is evaluated.
        running: whether sums are integrals over time: times the time step.
    """

    table: Cost | Target | Constraint
    kind: Literal["cost", "squares", "limit"]
    weight: float
    points: EvaluationPoints
    running: bool = False

    @property
    def formula(self) -> Formula:
        """Return what is evaluated."""
        return self.table.formula

    def bounds(self, size: int) -> tuple[Array, Array]:
        """Return the lower and upper bounds of a limit of ``size`` components, (steps * size,) step by step."""
        assert isinstance(self.table, Constraint), "nothing else has bounds"
        count = len(self.points.steps)
        ends = (np.broadcast_to(end, (size,)) for end in (self.table.lower, self.table.upper))
        lower, upper = (np.tile(end, count) for end in ends)
        return lower, upper


def cost_term(rollout: Rollout, cost: Cost) -> Term:
    """Return the term of a cost; ``always`` makes it an integral over time."""
    kind: Literal["squares", "cost"] = "squares" if cost.squares else "cost"
    if cost.at != "always":
        return Term(cost, kind, cost.weight, instant(rollout, cost.at))
    return Term(cost, kind, cost.weight, over_time(rollout, cost.formula, cost.during), True)


def target_term(rollout: Rollout, target: Target) -> Term:
    """Return the term of a target."""
    return Term(target, "squares", target.weight, instant(rollout, target.at))


def limit_term(rollout: Rollout, limit: Constraint) -> Term:
    """Return the term of a constraint; ``always`` is at the end of every step."""
    if limit.at != "always":
        return Term(limit, "limit", limit.penalty, instant(rollout, limit.at))
    steps = over_time(rollout, limit.formula, limit.during).steps
    return Term(limit, "limit", limit.penalty, EvaluationPoints(steps, (1,)), True)


def problem_terms(rollout: Rollout) -> list[Term]:
    """Return the terms of all costs, then targets, then constraints, in the order of the problem's tables."""
    problem = rollout.problem
    return [
        *(cost_term(rollout, cost) for cost in problem.costs),
        *(target_term(rollout, target) for target in problem.targets),
        *(limit_term(rollout, limit) for limit in problem.constraints),
    ]
