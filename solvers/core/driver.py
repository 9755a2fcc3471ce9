"""One solve from start to outcome: interruption and going on, foreign errors, what to say of a point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symphys.solvers.core.checkpoint import to_checkpoint
from symphys.solvers.core.continuation import Request, Stage, halfway, run_stages, words
from symphys.solvers.core.evaluator import Meter, Stop, Verdict
from symphys.solvers.core.outcome import Outcome, Status
from symphys.solvers.core.point import Point
from symphys.solvers.core.vanishing_gradient import FLAT, flat

INTERRUPTED = "interrupted; with its checkpoint the solve goes on from here"
MISSED = (
    "a stationary point where not everything is met: try another guess or seed, other weights, "
    "or stages such as smoothing = [0.1, 0.01, 0] in [simulation]"
)
START_NOT_FINITE = "the simulation of the start is not finite: look at the guess and at the formulas"
GRADIENT_NOT_FINITE = (
    "the cost is finite but its derivative is not: look for roots or norms of something that is zero in the formulas, "
    "or solve with smoothing above 0"
)


def run(request: Request, stage: Stage) -> Outcome:
    """Run every stage; whatever happens becomes a status with advice. SymphysError alone passes through."""
    meter = Meter(request.problem, request.monitor, request.constraints)
    log = request.log or silent
    try:
        verdict = run_stages(request, stage, meter, log)
    except KeyboardInterrupt:
        verdict = Verdict(Status.INTERRUPTED, INTERRUPTED)
    log(words(verdict))
    return outcome(request, meter, verdict)


def outcome(request: Request, meter: Meter, verdict: Verdict) -> Outcome:
    """The best point; of an interrupted solve that of its last complete iteration, and all that belongs to it."""
    snapshot = meter.snapshot
    if verdict.status is not Status.INTERRUPTED or snapshot is None:
        end = meter.stages[-1].z if meter.stages else meter.clip(np.array(request.start, float))
        z = end if meter.solution is None else meter.solution
        return Outcome(verdict.status, verdict.advice, z, tuple(meter.rows), replace(meter.counts), {}, meter.stages)
    rows = tuple(meter.rows[: snapshot.rows])
    return Outcome(
        verdict.status,
        verdict.advice,
        snapshot.best.z,
        rows,
        snapshot.counts,
        to_checkpoint(request.solver, snapshot, rows),
        (*snapshot.stages, halfway(request.problem, snapshot)),
    )


def begin(point: Point) -> Point:
    """The first point of a stage if it is finite; Stop(NOT_FINITE) otherwise."""
    if not point.finite:
        raise Stop(Status.NOT_FINITE, not_finite(point, START_NOT_FINITE).advice)
    return point


def not_finite(point: Point, advice: str) -> Verdict:
    """What to say of a point: ``advice`` where its values are not finite, else that its derivatives are not."""
    values = np.isfinite([point.merit, point.objective, *point.errors])
    return Verdict(Status.NOT_FINITE, GRADIENT_NOT_FINITE if np.all(values) else advice)


def converged(meter: Meter) -> Verdict:
    """A stationary point, with advice where the best point misses something or lies on a plateau."""
    best = meter.best
    if best is None or best.met:
        return Verdict(Status.CONVERGED)
    if flat(meter, best.z):
        return Verdict(Status.CONVERGED, FLAT)
    return Verdict(Status.CONVERGED, MISSED if best.errors.size else "")


def silent(line: str) -> None:
    """The log of one who wants none."""
