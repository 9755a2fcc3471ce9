"""One solve from start to outcome: stages of smoothing, interruption and continuation, foreign errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from symphys.shooting import ShootingProblem
from symphys.solvers.checkpoint import from_checkpoint, to_checkpoint
from symphys.solvers.interface import Log
from symphys.solvers.meter import Meter, Point, Stop, Verdict
from symphys.solvers.outcome import Array, Monitor, Outcome, Status
from symphys.solvers.plateau import FLAT, flat

FINISHED: dict[str, object] = {}
"""The state of a stage that has nothing left to do."""
INTERRUPTED = "interrupted; with its checkpoint the solve goes on from here"
MISSED = (
    "a stationary point where not everything is met: try another guess or seed, other weights, "
    "or stages of smoothing such as smoothing = [0.1, 0.01, 0]"
)
START_NOT_FINITE = "the simulation of the start is not finite: look at the guess and at the formulas"
GRADIENT_NOT_FINITE = (
    "the cost is finite but its derivative is not: look for roots or norms of something that is zero in the formulas, "
    "or solve with smoothing above 0"
)

Stage = Callable[[Meter, Array, "dict[str, object] | None"], Verdict]
"""Solve one stage from z, or from the solver's own state where a solve goes on; may raise Stop."""


@dataclass(frozen=True)
class Request:
    """What a solver was called with, its own options and seed aside.

    Attributes:
        solver: its name.
        problem, start, monitor, checkpoint, log: see ``interface.Solve``.
        smoothing: the stages; empty means the problem's own knob. Each starts from the best point of the one before.
            A stage before the last ends where its own targets are met; the solve ends there if its knob is 0.
    """

    solver: str
    problem: ShootingProblem
    start: Array
    smoothing: tuple[float, ...]
    monitor: Monitor | None
    checkpoint: dict[str, object] | None
    log: Log | None

    @property
    def stages(self) -> tuple[float, ...]:
        """At least one."""
        return self.smoothing or (self.problem.smoothing,)


def run(request: Request, stage: Stage) -> Outcome:
    """Run every stage; whatever happens becomes a status with advice. SymphysError alone passes through."""
    meter = Meter(request.problem, request.monitor)
    log = request.log or silent
    try:
        verdict = run_stages(request, stage, meter, log)
    except KeyboardInterrupt:
        verdict = Verdict(Status.INTERRUPTED, INTERRUPTED)
    except (RuntimeError, ArithmeticError, np.linalg.LinAlgError) as error:
        verdict = Verdict(Status.FAILED, f"{request.solver} failed: {str(error).strip() or type(error).__name__}")
    log(": ".join(filter(None, (verdict.status.value, verdict.advice))))
    return outcome(request, meter, verdict)


def run_stages(request: Request, stage: Stage, meter: Meter, log: Log) -> Verdict:
    """One stage after the other, each from the best point of the last; the verdict is that of the last one run."""
    z, first = meter.clip(np.array(request.start, float)), 0
    state: dict[str, object] | None = None
    if request.checkpoint:
        snapshot, state, rows = from_checkpoint(request.checkpoint, request.solver, request.problem)
        meter.restore(snapshot, rows)
        z, first = snapshot.best.z, snapshot.stage
    verdict = Verdict(Status.MET)
    for index, smoothing in enumerate(request.stages[first:], first):
        meter.enter(index, smoothing, resumed=state is not None)
        log(f"stage {index + 1} of {len(request.stages)}: smoothing {smoothing:g}")
        verdict = Verdict(Status.MET) if state == FINISHED else run_stage(meter, stage, z, state)
        if is_final(verdict, smoothing):
            break
        z, state = (meter.best.z if meter.best else z), None
    return verdict


def run_stage(meter: Meter, stage: Stage, z: Array, state: dict[str, object] | None) -> Verdict:
    """Run a stage; a point that ended it in the middle of an iteration gets its row in the trace."""
    try:
        return stage(meter, z, state)
    except Stop as stop:
        if stop.verdict.status is Status.MET and meter.best:
            before = meter.best.z if meter.last is None else meter.last
            meter.commit(meter.best, FINISHED, step=float(np.linalg.norm(meter.best.z - before)))
        return stop.verdict


def is_final(verdict: Verdict, smoothing: float) -> bool:
    """Whether a stage before the last ends the whole solve."""
    if verdict.status is Status.MET:
        return smoothing == 0
    return verdict.status in (Status.NOT_FINITE, Status.NOT_APPLICABLE, Status.FAILED)


def outcome(request: Request, meter: Meter, verdict: Verdict) -> Outcome:
    """The best point; of an interrupted solve that of its last complete iteration, and all that belongs to it."""
    snapshot = meter.snapshot
    if verdict.status is not Status.INTERRUPTED or snapshot is None:
        z = meter.best.z if meter.best else meter.clip(np.array(request.start, float))
        return Outcome(verdict.status, verdict.advice, z, tuple(meter.rows), replace(meter.counts))
    rows = tuple(meter.rows[: snapshot.rows])
    checkpoint = to_checkpoint(request.solver, snapshot, rows)
    return Outcome(verdict.status, verdict.advice, snapshot.best.z, rows, snapshot.counts, checkpoint)


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
