"""One solve: solve, judge by the exact rollout, examine, and write all but the result itself."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from symphys import files
from symphys import verification as trust
from symphys.errors import SymphysError
from symphys.findings.examination import Examination
from symphys.findings.obstacles import obstacles
from symphys.findings.writing import capital
from symphys.results.file_names import CHECKPOINT, GAINS, GUESS, MULTIPLIERS, SCENE, TRAJECTORY
from symphys.results.result import Result
from symphys.results.scene_of_problem import make_scene
from symphys.runs.claim import Claim
from symphys.runs.job import Job
from symphys.runs.record import Judgement, judged, make_result, trace_row, used
from symphys.runs.standing import Standing
from symphys.shooting import ShootingProblem
from symphys.solvers import OUTCOME, Keep, Monitor, Outcome, Status, plain_outcome, revived_outcome, solver
from symphys.transcription import Record, Transcription
from symphys.types import Array

SMOOTHED = (
    "what the solver's smoothed rollout meets, the exact one does not: lower the smoothing, or add a stage at 0, "
    "such as smoothing = [0.1, 0.01, 0]"
)

DIFFERENTIATING = ("gradient", "least_squares", "ipopt", "stochastic")
"""Solvers whose gradients are those of the backend: the staged ones have theirs in double precision always."""
JUDGING = "rolling it out exactly"
"""What announces the judging of a solution."""


def silent(what: str) -> None:
    """Tell nobody."""


def solve(
    job: Job,
    transcription: Transcription,
    claim: Claim,
    monitor: Monitor,
    log: Callable[[str], None],
    keep: Keep,
    found: Standing,
    solved: Outcome | None = None,
    tell: Callable[[str], None] = silent,
    bounded: bool = False,
) -> Result:
    """Solve from the seed's guess, or go on from the checkpoint that was ``found``; write what comes of it.

    ``solved``: what was found already, side by side with other seeds; its seconds are those of the group. ``tell``: is
    called with a few words before each part of judging what was found. ``bounded``: whether a limit may kill the
    process, so that what the solver has found is kept before it is judged.
    """
    shooting = replace(transcription.shooting, multipliers=job.guess.multipliers)
    log(f"evaluated by {transcription.backend}")
    for note in job.guess.notes:
        log(f"guess from {job.guess.folder}: {note}")
    start = shooting.start(job.config.seed)
    at_once = found.result is not None  # else nothing counts before the result is written
    claim.check()
    files.write_npz(job.folder.path / GUESS, transcription.simulate(start).arrays(), at_once)
    if solved is None:
        outcome, spent = alone(
            job, shooting, start, monitor, log, keep, found.checkpoint, transcription.backend.precision == "single"
        )
        if doubt := transcription.backend.later():
            log(doubt)
        keep_outcome(job, claim, outcome, spent + spent_before(found), bounded)
    else:
        log("solved side by side with other seeds: the seconds are those of all")
        outcome, spent = solved, solved.trace[-1].seconds if solved.trace else 0.0
    spent += spent_before(found)
    judgement = judge(transcription, outcome, job.examine, tell)
    price = transcription.prices(used(outcome.counts))
    claim.check()
    write(job, transcription, outcome, judgement, price, at_once)
    seconds = {"build": transcription.build_seconds, "compile": transcription.backend.seconds, "solve": spent}
    return make_result(job, transcription, outcome, judgement, price, seconds)


def alone(
    job: Job,
    shooting: ShootingProblem,
    start: Array,
    monitor: Monitor,
    log: Callable[[str], None],
    keep: Keep,
    checkpoint: dict[str, Any] | None,
    single: bool = False,
) -> tuple[Outcome, float]:
    """Solve; the outcome and the seconds that it took. One that was found already waits in the checkpoint.

    ``single``: whether gradients are in single precision.
    """
    if checkpoint and OUTCOME in checkpoint:
        log("solved before; what it found is judged")
        return revived_outcome(checkpoint, job.config.solver), 0.0
    chosen = solver(job.config.solver)
    chosen.prepare()
    began = time.perf_counter()
    if single and job.config.solver in DIFFERENTIATING:
        compare_precision(shooting, start, getattr(job.options, "smoothing", (0.0,))[0], log)
    outcome = chosen.solve(
        shooting, start, job.options, job.config.seed, monitor=monitor, checkpoint=checkpoint, log=log, keep=keep
    )
    return outcome, time.perf_counter() - began


def keep_outcome(job: Job, claim: Claim, outcome: Outcome, seconds: float, bounded: bool) -> None:
    """Write what the solver needs to go on, or, where a limit may end the judging, what it has found."""
    if outcome.status is Status.INTERRUPTED:
        claim.publish(CHECKPOINT, files.json_text(outcome.checkpoint).encode())
    elif bounded:
        kept = plain_outcome(outcome, job.config.solver, seconds)
        claim.publish(CHECKPOINT, files.json_text(kept).encode())


def compare_precision(shooting: ShootingProblem, start: Array, smoothing: float, log: Callable[[str], None]) -> None:
    """Evaluate the first gradient, which the kernel compares with double precision; see ``backends.precision``."""
    log("comparing the first gradient with double precision")
    shooting.evaluator.gradient(start[None], smoothing)


def spent_before(found: Standing) -> float:
    """[s] of solving before the checkpoint; of a process that was killed up to its last iteration there."""
    if not found.checkpoint:
        return 0.0
    if found.result:
        return found.result.seconds.get("solve", 0.0)
    seconds = found.checkpoint.get("seconds", 0.0)
    return float(seconds) if isinstance(seconds, int | float) else 0.0


def judge(
    transcription: Transcription, outcome: Outcome, examine: bool = True, tell: Callable[[str], None] = silent
) -> Judgement:
    """Roll the solution out exactly, and examine it; ``tell`` as in ``solve``."""
    tell(JUDGING)
    try:
        verdict = transcription.judge(outcome.z)
        taken = transcription.record(outcome.z)
        over = outcome.status is not Status.INTERRUPTED
        examined = measured(transcription, taken, examine, tell) if over else None
    except SymphysError as error:
        return Judgement(None, None, None, f"{outcome.advice} {error}".strip())
    smoothed = outcome.status is Status.MET and not verdict.solved and outcome.trace[-1].smoothing > 0
    well = verdict.solved and outcome.status in (Status.MET, Status.CONVERGED)
    known = Examination.from_json(files.strict(examined or {}))
    found = () if well else obstacles(known, judged(verdict))
    # more iterations do not help where the costs outweigh a target
    rest = "" if found and known.outweighed else outcome.advice or SMOOTHED * smoothed
    return Judgement(verdict, taken.motion, examined, told([*found, rest]))


def told(clauses: list[str]) -> str:
    """Clauses as sentences, empty ones left out; the first begins as it is written, and the last has no full stop."""
    known = [clause for clause in clauses if clause]
    return ". ".join([*known[:1], *map(capital, known[1:])])


def measured(transcription: Transcription, taken: Record, examine: bool, tell: Callable[[str], None]) -> dict[str, Any]:
    """The object "trust" of the result."""
    return trust.examine(transcription, taken.z, tell) if examine else trust.survey(transcription, taken)


def write(
    job: Job,
    transcription: Transcription,
    outcome: Outcome,
    judgement: Judgement,
    price: Mapping[str, float],
    at_once: bool,
) -> None:
    """Write trace, gains, motion and checkpoint."""
    job.folder.write_trace([trace_row(row, price) for row in outcome.trace], at_once)
    if outcome.gains:
        files.write_npz(job.folder.path / GAINS, outcome.gains, at_once)
    if judgement.trajectory is not None:
        files.write_npz(job.folder.path / TRAJECTORY, judgement.trajectory.arrays(), at_once)
        z = transcription.shooting.by_block(outcome.z)
        scene = make_scene(job.problem, z, judgement.trajectory)
        files.write_json(job.folder.path / SCENE, scene.to_json(), at_once)
    if outcome.multipliers:
        files.write_npz(job.folder.path / MULTIPLIERS, outcome.multipliers, at_once)
