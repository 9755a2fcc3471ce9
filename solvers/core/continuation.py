"""Continuation: a solve as stages of smoothing, from large to small, each from the best point of the one before.

What a stage hands on is a point and nothing else. Step lengths, damping and sigma begin anew: those that a stage ends
with are small because it has converged, and say nothing of the next one, whose merit is another function. A stage ends
as a solve does, when it has converged, stalled or used up its budget, each stage having the whole of it; where the
problem stops at the first point that meets everything, a stage stops at the first that does at its own smoothing. The
last stage decides how the solve ended: what an earlier one met at its own smoothing counts for nothing. Its best point
is the solution, unless the start or the point of another stage does better at smoothing 0, see ``comparison``.

A solver knows nothing of this: it gives one function that minimises at the meter's smoothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import astuple, dataclass

import numpy as np

from symphys.shooting import ShootingProblem
from symphys.solvers.core.checkpoint import from_checkpoint
from symphys.solvers.core.comparison import Rate, compared
from symphys.solvers.core.evaluator import Meter, Snapshot, Stop, Verdict
from symphys.solvers.core.interface import Log
from symphys.solvers.core.outcome import Array, Counts, Monitor, StageResult, Status

FINISHED: dict[str, object] = {}
"""The state of a stage that has nothing left to do."""
FATAL = (Status.NOT_APPLICABLE, Status.FAILED)
"""What ends the solve in whatever stage it happens. Numbers that are not finite may be so at one smoothing only."""

Stage = Callable[[Meter, Array, "dict[str, object] | None"], Verdict]
"""Solve one stage from z, or from the solver's own state where a solve goes on; may raise Stop."""


@dataclass(frozen=True)
class Request:
    """What a solver was called with, its own options and seed aside.

    Attributes:
        solver: its name.
        problem, start, monitor, checkpoint, log: see ``interface.Solve``.
        constraints: whether the solver knows constraints, so that violated ones come before the merit.
        rate: how the solver compares points; None: by one rollout each.
    """

    solver: str
    problem: ShootingProblem
    start: Array
    monitor: Monitor | None
    checkpoint: dict[str, object] | None
    log: Log | None
    constraints: bool = False
    rate: Rate | None = None


def run_stages(request: Request, stage: Stage, meter: Meter, log: Log) -> Verdict:
    """One stage after the other; the verdict is that of the last one run."""
    z = meter.clip(np.array(request.start, float))
    state: dict[str, object] | None = None
    if request.checkpoint:
        snapshot, state, rows = from_checkpoint(request.checkpoint, request.solver, request.problem)
        meter.restore(snapshot, rows)
        z = snapshot.stages[-1].z if snapshot.stages else z
    verdict, knobs = Verdict(Status.MET), request.problem.smoothing
    for index, smoothing in enumerate(knobs[len(meter.stages) :], len(meter.stages)):
        meter.enter(smoothing, resumed=state is not None)
        log(f"stage {index + 1} of {len(knobs)}: smoothing {smoothing:g}")
        verdict = Verdict(Status.MET) if state == FINISHED else run_stage(request.solver, meter, stage, z, state)
        z, state = (meter.best.z if meter.best else z), None
        over, status = verdict.status in FATAL or index + 1 == len(knobs), verdict.status
        if over:
            verdict = compared(meter, request.rate or Meter.rated, request.start, z, verdict)
        meter.stages = (*meter.stages, ended(meter, status, z))
        if over:
            break
        log(words(verdict))
    return verdict


def run_stage(solver: str, meter: Meter, stage: Stage, z: Array, state: dict[str, object] | None) -> Verdict:
    """Run a stage; errors of foreign code, and matrices that there is no memory for, become a verdict."""
    try:
        return attempt(meter, stage, z, state)
    except (RuntimeError, ArithmeticError, np.linalg.LinAlgError, MemoryError) as error:
        return Verdict(Status.FAILED, f"{solver} failed: {str(error).strip() or type(error).__name__}")


def attempt(meter: Meter, stage: Stage, z: Array, state: dict[str, object] | None) -> Verdict:
    """Run a stage; a point that ended it in the middle of an iteration gets its row in the trace."""
    try:
        return stage(meter, z, state)
    except Stop as stop:
        if stop.verdict.status is Status.MET and meter.best:
            before = meter.best.z if meter.last is None else meter.last
            meter.commit(meter.best, FINISHED, step=float(np.linalg.norm(meter.best.z - before)))
        return stop.verdict


def ended(meter: Meter, status: Status, z: Array) -> StageResult:
    """The stage that is over, whose best point is ``z``."""
    spent = less(meter.counts, (stage.counts for stage in meter.stages))
    seconds = meter.seconds - sum(stage.seconds for stage in meter.stages)
    objective, miss = (meter.best.objective, meter.best.miss) if meter.best else (np.nan, np.nan)
    return StageResult(meter.smoothing, status, z, objective, miss, spent, seconds)


def halfway(problem: ShootingProblem, snapshot: Snapshot) -> StageResult:
    """The stage that an interruption has cut short."""
    before, best = snapshot.stages, snapshot.best
    spent = less(snapshot.counts, (stage.counts for stage in before))
    seconds = snapshot.seconds - sum(stage.seconds for stage in before)
    smoothing = problem.smoothing[len(before)]
    return StageResult(smoothing, Status.INTERRUPTED, best.z, best.objective, best.miss, spent, seconds)


def less(total: Counts, parts: Iterable[Counts]) -> Counts:
    """The work that is not in the parts."""
    return Counts(*(whole - sum(some) for whole, *some in zip(*map(astuple, (total, *parts)), strict=True)))


def words(verdict: Verdict) -> str:
    """A verdict in a line of the log."""
    return ": ".join(filter(None, (verdict.status.value, verdict.advice)))
