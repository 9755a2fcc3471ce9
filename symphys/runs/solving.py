"""The heart of a run: solve, judge by the exact rollout, examine, and write all but the result itself."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from symphys import files
from symphys import verification as trust
from symphys.errors import SymphysError
from symphys.findings.levels import Judged
from symphys.findings.verdict import rule
from symphys.results.result import BlockRecord, CheckRecord, Result, ruled
from symphys.results.scene import scene
from symphys.runs.cost import equivalents, used
from symphys.runs.folder import CHECKPOINT, GUESS, SCENE, TOLD, TRAJECTORY
from symphys.runs.job import Job
from symphys.runs.provenance import evaluated, stamp
from symphys.runs.stages import guess_record, stage_records
from symphys.shooting import Array, ShootingProblem
from symphys.solvers import Monitor, Outcome, Status, TraceRow, solver
from symphys.trajectory import Trajectory
from symphys.transcription import Assessment, Criterion, Record, Transcription

SMOOTHED = (
    "what the solver's smoothed rollout meets, the exact one does not: lower the smoothing, or add a stage at 0, "
    "such as smoothing = [0.1, 0.01, 0]"
)


@dataclass(frozen=True)
class Judgement:
    """What the exact rollout of the solution says; all None where it cannot be simulated.

    Attributes:
        verdict: costs and checks.
        trajectory: the motion.
        trust: how far the solution can be trusted, or, not examined, what is always measured; None also for a run that
            is not over.
        advice: the solver's and what the rollout adds.
    """

    verdict: Assessment | None
    trajectory: Trajectory | None
    trust: dict[str, Any] | None
    advice: str


def solve(
    job: Job,
    transcription: Transcription,
    monitor: Monitor,
    log: Callable[[str], None],
    checkpoint: dict[str, object] | None,
    earlier: Result | None,
    solved: Outcome | None = None,
) -> Result:
    """Solve from the seed's guess, or go on from ``checkpoint`` of the ``earlier`` result; write what was found.

    ``solved``: what was found already, side by side with other seeds; its seconds are those of the group.
    """
    shooting = transcription.shooting
    log(f"evaluated by {transcription.backend}")
    start = shooting.start(job.config.seed)
    files.write_npz(job.folder.path / GUESS, transcription.simulate(start).arrays())
    if solved is None:
        outcome, spent = alone(job, shooting, start, monitor, log, checkpoint)
    else:
        log("solved side by side with other seeds: the seconds are those of all")
        outcome, spent = solved, solved.trace[-1].seconds if solved.trace else 0.0
    spent += ((earlier and earlier.seconds) or {}).get("solve", 0.0)
    judgement = judge(transcription, outcome, job.examine)
    price = transcription.prices(used(outcome.counts))
    write(job, transcription, outcome, judgement, price)
    seconds = {"build": transcription.build_seconds, "compile": transcription.backend.seconds, "solve": spent}
    return record(job, transcription, outcome, judgement, price, seconds)


def alone(
    job: Job,
    shooting: ShootingProblem,
    start: Array,
    monitor: Monitor,
    log: Callable[[str], None],
    checkpoint: dict[str, object] | None,
) -> tuple[Outcome, float]:
    """Solve; the outcome and the seconds that it took."""
    chosen = solver(job.config.solver)
    chosen.prepare()
    began = time.perf_counter()
    outcome = chosen.solve(
        shooting, start, job.options, job.config.seed, monitor=monitor, checkpoint=checkpoint, log=log
    )
    return outcome, time.perf_counter() - began


def judge(transcription: Transcription, outcome: Outcome, examine: bool = True) -> Judgement:
    """Roll the solution out exactly, and examine it."""
    try:
        verdict = transcription.judge(outcome.z)
        taken = transcription.record(outcome.z)
        over = outcome.status is not Status.INTERRUPTED
        examined = measured(transcription, taken, examine) if over else None
    except SymphysError as error:
        return Judgement(None, None, None, f"{outcome.advice} {error}".strip())
    smoothed = outcome.status is Status.MET and not verdict.solved and outcome.trace[-1].smoothing > 0
    return Judgement(verdict, taken.motion, examined, outcome.advice or (SMOOTHED if smoothed else ""))


def measured(transcription: Transcription, taken: Record, examine: bool) -> dict[str, Any]:
    """The object "trust" of the result."""
    return trust.examine(transcription, taken.z) if examine else trust.survey(transcription, taken)


def write(
    job: Job, transcription: Transcription, outcome: Outcome, judgement: Judgement, price: Mapping[str, float]
) -> None:
    """Write trace, motion and checkpoint."""
    job.folder.write_trace([columns(row, price) for row in outcome.trace])
    if judgement.trajectory is not None:
        files.write_npz(job.folder.path / TRAJECTORY, judgement.trajectory.arrays())
        z = transcription.shooting.by_block(outcome.z)
        files.write_json(job.folder.path / SCENE, scene(job.problem, z, judgement.trajectory))
    if outcome.status is Status.INTERRUPTED:
        files.write_json(job.folder.path / CHECKPOINT, outcome.checkpoint)


def columns(row: TraceRow, price: Mapping[str, float]) -> dict[str, object]:
    """A row of the trace as a line of a table."""
    numbers = asdict(row)
    told = numbers.pop("told")
    return {**numbers, "equivalents": equivalents(row, price), **{TOLD + name: value for name, value in told.items()}}


def record(
    job: Job,
    transcription: Transcription,
    outcome: Outcome,
    judgement: Judgement,
    price: dict[str, float],
    seconds: dict[str, float],
) -> Result:
    """Everything that result.json says."""
    verdict = judgement.verdict
    return Result(
        **stamp(job),
        backend=evaluated(transcription.backend),
        **ruled(rule(outcome.status.value, judged(verdict), files.strict(judgement.trust))),
        status=outcome.status.value,
        advice=judgement.advice,
        objective=verdict.objective if verdict else None,
        costs=dict(verdict.costs) if verdict else None,
        outputs=dict(verdict.outputs) if verdict else None,
        checks=[check_record(check) for check in verdict.checks] if verdict else None,
        z=blocks(transcription, outcome.z),
        iterations=outcome.trace[-1].iteration if outcome.trace else 0,
        counts=asdict(outcome.counts),
        price=price,
        equivalents=equivalents(outcome.counts, price),
        seconds=seconds,
        trust=judgement.trust,
        guess=guess_record(transcription, job.config.seed),
        stages=stage_records(transcription, outcome, price),
    )


def judged(verdict: Assessment | None) -> Judged:
    """What is known of how the exact rollout does."""
    if verdict is None:
        return Judged(np.nan, np.nan, met=False, checked=False)
    return Judged(verdict.objective, verdict.worst, verdict.solved, bool(verdict.checks))


def check_record(check: Criterion) -> CheckRecord:
    """A check as JSON."""
    return CheckRecord(
        kind=check.kind,
        name=check.name,
        error=check.error,
        tolerance=check.tolerance,
        ratio=check.ratio,
        met=check.met,
    )


def blocks(transcription: Transcription, z: Array) -> dict[str, BlockRecord]:
    """The variables by name, flat, knot after knot."""
    sets = {v.name: [slot.name for slot in v.slots] for v in transcription.problem.variables}
    return {
        block.name: BlockRecord(
            sets=sets[block.name],
            shape=list(block.shape),
            value=z[block.start : block.stop].tolist(),
            guess=block.guess.tolist(),
            lower=bounds(block.lower),
            upper=bounds(block.upper),
        )
        for block in transcription.shooting.blocks
    }


def bounds(values: Array) -> list[float | None]:
    """Bounds as JSON: None where there is none."""
    return [value if np.isfinite(value) else None for value in values.tolist()]
