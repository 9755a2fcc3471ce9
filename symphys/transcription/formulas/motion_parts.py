"""What a formula takes of a whole motion: values at its start and end, integrals and averages over its time."""

from __future__ import annotations

import casadi as ca

from symphys.expression import Formula, MotionPart
from symphys.transcription.objective import Sampled
from symphys.types import Expr


def part_arguments(samples: Sampled, formula: Formula) -> list[Expr]:
    """The last argument of a compiled formula: all of its parts, one after the other; nothing for one without parts."""
    if not formula.parts:
        return []
    return [ca.vertcat(*(_part(samples, part) for part in formula.parts))]


def _part(samples: Sampled, part: MotionPart) -> Expr:
    """(m,): the part of a rollout; integrals by the rule of running costs, see ``Sampled.over_steps``."""
    if part.kind in ("start", "end"):
        return samples.at(part.formula, 0.0 if part.kind == "start" else "end")
    values = samples.over_steps(part.formula)
    average = ca.sum2(values) / values.shape[1]
    return average if part.kind == "average" else samples.interval * samples.steps * average
