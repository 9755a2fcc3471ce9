"""Continuation: stages of smoothing, from large to small, each from the best point of the previous stage.

A stage passes on a point and nothing else. Step lengths, damping and sigma begin anew: those that a stage ends with are
small because it has converged, and do not fit the next one, whose merit is another function. A stage ends as a solve
does, when it has converged, stalled or used up its budget, each stage having the whole of it; where the problem stops
at the first point that meets everything, a stage stops at the first that does at its own smoothing. The last stage
decides how the solve ended: what an earlier one met at its own smoothing counts for nothing.

Smoothed merits do not bound exact ones: the best point of a stage may be worse at smoothing 0 than where it started. So
at the end of the last stage its point, those of the other stages and the start are all rated at 0. The solution is that
of the last stage unless another is strictly better. A solve without smoothing has compared all of its points already.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.outcome import Counts, StageResult, Status, StopReason
from symphys.solvers.core.point import Incumbent, Point
from symphys.types import Array

Rate = Callable[[CountingEvaluator, Sequence[Array]], list[Point]]
"""Evaluates points by the solver's own measure, without offering them to the incumbent; [] if it has none."""
EXACT_SMOOTHING = 0.0
BETTER_CANDIDATE = (
    "{} is better in the exact rollout than the last stage, and is kept. The later stages improved the smoothed "
    "problem only: try other stages, or none"
)


def stage_result(
    smoothing: float,
    status: Status,
    z: Array,
    best: Point | None,
    total: tuple[Counts, float],
    before: Sequence[StageResult],
) -> StageResult:
    """Return the result of a stage that ended at ``z``; ``total``: work and seconds up to its end, with ``before``."""
    counts, seconds = total
    for stage in before:
        counts -= stage.counts
    seconds -= sum(stage.seconds for stage in before)
    objective, max_violation = (best.objective, best.max_violation) if best else (np.nan, np.nan)
    return StageResult(smoothing, status, z, objective, max_violation, counts, seconds)


def exact_best(
    evaluator: CountingEvaluator,
    rate: Rate,
    start: Array,
    stages: Sequence[StageResult],
    z: Array,
    reason: StopReason,
) -> tuple[StopReason, Array]:
    """Return why a solve ends and its solution (n,); the last stage ended at ``z`` (n,) for ``reason``.

    Args:
        evaluator: of the last stage.
        rate: how the solver compares points.
        start: (n,) of the solve, within the bounds.
        stages: those before the last.
        z: (n,) the point of the last stage.
        reason: why the last stage ended.
    """
    problem = evaluator.problem
    if problem.smoothing == (EXACT_SMOOTHING,) or reason.status is Status.NOT_APPLICABLE:
        return reason, z
    points = _rated(evaluator, rate, [z, *(stage.z for stage in stages), start])
    if not points:
        return reason, z
    last, *others = points
    if evaluator.smoothing == EXACT_SMOOTHING and evaluator.incumbent.best is not None:
        last = evaluator.incumbent.best
    chosen = last
    for point in others:
        chosen = point if point.better(chosen) else chosen
    if chosen is last:
        return reason, z
    advice = BETTER_CANDIDATE.format(_name(stages, chosen.z))
    if chosen.met and problem.stop_when_met:
        return StopReason(Status.MET, advice), chosen.z
    if reason.whole:
        return reason, chosen.z
    gained = reason.status in (Status.MET, Status.CONVERGED)
    return StopReason(Status.STALLED if gained else reason.status, advice), chosen.z


def _rated(evaluator: CountingEvaluator, rate: Rate, candidates: Sequence[Array]) -> list[Point]:
    """Evaluate candidates at smoothing 0; return [] if that fails or all candidates are equal."""
    if all(np.array_equal(each, candidates[0]) for each in candidates):
        return []
    try:
        return rate(evaluator.at(EXACT_SMOOTHING, Incumbent(stop_when_met=False)), candidates)
    except (RuntimeError, ArithmeticError, np.linalg.LinAlgError):
        return []


def _name(stages: Sequence[StageResult], z: Array) -> str:
    """Return the name of a candidate in the advice."""
    for stage in stages:
        if np.array_equal(stage.z, z):
            return f"the point of the stage at smoothing {stage.smoothing:g}"
    return "the guess"
