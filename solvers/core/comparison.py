"""The last word of a solve with smoothing: its start and the points of its stages, compared where they are judged.

Smoothed merits say nothing of exact ones: the best point of a stage may be worse at smoothing 0 than where it started.
So at the end of the last stage all of these are rated at 0, and the best is the solution. That of the last stage is it
unless another is strictly better. A solve without smoothing has compared all of its points already.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symphys.solvers.core.evaluator import Meter, Verdict
from symphys.solvers.core.outcome import Array, Status
from symphys.solvers.core.point import Point

Rate = Callable[[Meter, Sequence[Array]], list[Point]]
"""Rates points at the meter's smoothing as the solver compares them, and remembers none; [] where it compares none."""
EXACT = 0.0
OVERTAKEN = (
    "{} does better in the exact rollout than what the last stage came to, and is kept: what the stages gained, they "
    "gained for another problem; try other stages, or none"
)


def compared(meter: Meter, rate: Rate, start: Array, z: Array, verdict: Verdict) -> Verdict:
    """The verdict on the solve, whose last stage came to ``z`` (n,); sets the meter's solution."""
    knobs, status = meter.problem.smoothing, verdict.status
    if knobs == (EXACT,) or status is Status.NOT_APPLICABLE:
        return verdict
    points = rated(meter, rate, [z, *(stage.z for stage in meter.stages), meter.clip(np.array(start, float))])
    if not points:
        return verdict
    here, *others = points
    best = here if meter.smoothing != EXACT or meter.best is None else meter.best
    chosen = best
    for point in others:
        chosen = point if point.better(chosen) else chosen
    if chosen is best:
        return verdict
    meter.solution = chosen.z
    return Verdict(overtaken(meter, chosen, status), OVERTAKEN.format(name(meter, chosen.z)))


def rated(meter: Meter, rate: Rate, candidates: Sequence[Array]) -> list[Point]:
    """At smoothing 0; [] where that fails, or where the candidates are all the same."""
    if all(np.array_equal(each, candidates[0]) for each in candidates):
        return []
    knob, meter.smoothing = meter.smoothing, EXACT
    try:
        return rate(meter, candidates)
    except (RuntimeError, ArithmeticError, np.linalg.LinAlgError):
        return []
    finally:
        meter.smoothing = knob


def overtaken(meter: Meter, point: Point, status: Status) -> Status:
    """How a solve ended whose last stage ended otherwise, but whose solution is another point."""
    if point.met and meter.problem.stop_when_met:
        return Status.MET
    return Status.STALLED if status in (Status.MET, Status.CONVERGED) else status


def name(meter: Meter, z: Array) -> str:
    """What to call a candidate."""
    for stage in meter.stages:
        if np.array_equal(stage.z, z):
            return f"the point of the stage at smoothing {stage.smoothing:g}"
    return "the guess"
