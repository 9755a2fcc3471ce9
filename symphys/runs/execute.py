"""One run from start to finished folder: claim it, solve, judge by the exact rollout, examine, write."""

from __future__ import annotations

import contextlib
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from time import monotonic
from typing import Any

import numpy as np

from symphys import files
from symphys import verification as trust
from symphys.codegen.backends import PRECISIONS, require_kernels
from symphys.errors import SymphysError, Unavailable
from symphys.findings.examination import Examination
from symphys.findings.numerics import WORST_LIMITS
from symphys.findings.obstacles import obstacles
from symphys.findings.verdict import doubts, holds
from symphys.findings.writing import capital
from symphys.problem import Problem
from symphys.results.file_names import CHECKPOINT, FILM, GAINS, GUESS, LOG, MULTIPLIERS, RESULT, SCENE, TRAJECTORY
from symphys.results.film import FilmMotions, film_size
from symphys.results.result import Result
from symphys.results.scene_of_problem import make_scene
from symphys.results.table.journal import Journal
from symphys.runs.claim import Claim, FolderBusy, claimed, clear
from symphys.runs.inspection import UNFINISHED, RunInspection, RunState, inspect_run
from symphys.runs.job import Job
from symphys.runs.record import Judgement, checkpoint_rows, failure, interruption, judged, make_result, trace_row, used
from symphys.shooting import ShootingProblem
from symphys.solvers import OUTCOME, Keep, Monitor, Outcome, Status, plain_outcome, revived_outcome, solver
from symphys.trajectory import NotFinite
from symphys.transcription import Transcription, guessed
from symphys.types import Array

Transcribe = Callable[[Problem, bool], Transcription]
"""(problem, whether it is only ever evaluated without smoothing) -> its transcription."""
Transcriptions = Callable[[Job], Transcription]
"""Job -> the transcription of its problem, such as a ``TranscriptionCache``."""
NO_SAMPLES = "samples of [[scenario]] tables are evaluated by compiled kernels, and none can be made here"
SMOOTHED_ONLY = (
    "the smoothed rollout meets every check, the exact one does not: lower the smoothing, or add a stage at 0, "
    "e.g. smoothing = [0.1, 0.01, 0]"
)
DIFFERENTIATING = ("gradient", "least_squares", "ipopt", "stochastic")
"""Solvers that use the backend's gradients; those that solve stage by stage always have double precision."""
JUDGING = "rolling it out exactly"
"""The progress message with which judging a solution begins."""
CHECKPOINT_INTERVAL = 10.0
"""[s] at least between two checkpoints of a run."""
MIN_CHECKPOINT_SPACING = 50
"""Least time between checkpoints, in units of the time to write one."""


def no_callback(_: object) -> None:
    """No-op."""


class TranscriptionCache:
    """The transcription of the most recent problem; only one is kept, since one problem's functions may be large."""

    def __init__(self, transcribe: Transcribe) -> None:
        """Start empty."""
        self.transcribe = transcribe
        self.made: tuple[object, Transcription] | None = None

    def __call__(self, job: Job) -> Transcription:
        """Return the transcription of the job's problem, with the job's guess."""
        if self.made is None or self.made[0] != job.subject:
            self.made = None
            self.made = (job.subject, self.transcribe(job.problem, not job.smooth))
        return guessed(self.made[1], job.problem) if job.guess.digest else self.made[1]


def execute(
    job: Job,
    monitor: Monitor,
    transcriptions: Transcriptions,
    solved: Outcome | None = None,
    tell: Callable[[str], None] = no_callback,
    begin: Callable[[bool], None] = no_callback,
    bounded: bool = False,
) -> Result:
    """Do the run, or resume it, unless it is over; write its folder; return the result.

    ``monitor`` sees each iteration and may raise KeyboardInterrupt, which ends the run so that it can resume later.
    ``solved``: the outcome if seeds were solved side by side. ``tell``: see ``solve``. ``begin`` is called once the run
    is claimed, with whether it resumes; not for a run that was over. ``bounded``: whether a limit may kill this
    process, so that checkpoints are written as often as they are cheap.
    A run that fails gives a result with the status "failed", as does one whose folder cannot be written.

    Raises:
        FolderBusy: another process is working on this run, or has taken it over.
    """
    found = inspect_run(job)
    if found.result and is_over(job, found):
        return found.result
    try:
        with claimed(job.folder.path) as claim:
            return with_claim(job, claim, monitor, transcriptions, solved, tell, begin, bounded)
    except FolderBusy:
        raise
    except files.FileError as error:
        return failure(job, str(error), again=True)


def with_claim(
    job: Job,
    claim: Claim,
    monitor: Monitor,
    transcriptions: Transcriptions,
    solved: Outcome | None = None,
    tell: Callable[[str], None] = no_callback,
    begin: Callable[[bool], None] = no_callback,
    bounded: bool = False,
) -> Result:
    """Do what ``execute`` does for a run that this process has claimed; FileError if the folder cannot be written."""
    found = inspect_run(job)
    if found.result and is_over(job, found):
        return found.result
    begin(found.checkpoint is not None)
    job.folder.clear()
    clear(job.folder.path, claim)
    if not found.checkpoint:
        job.folder.begin(job.config, job.problem.text)
    log = Log(job)
    keeper = CheckpointKeeper(claim, log, 0.0 if bounded else CHECKPOINT_INTERVAL)
    try:
        result = solve(job, transcribed(job, transcriptions), claim, monitor, log, keeper, found, solved, tell, bounded)
    except files.FileError:
        raise
    except Unavailable as error:
        result = failure(job, str(error), again=True)
    except SymphysError as error:
        result = failure(job, str(error))
    except Exception as error:  # one broken run must not take the others with it
        log(traceback.format_exc())
        result = failure(job, f"unexpected {type(error).__name__}: {error} (details in {job.folder.path / LOG})")
    finally:
        with contextlib.suppress(files.FileError):  # a full disk is reported by what comes after
            claim.check()
            log.write()
    # the result is written last, so that it exists only where the other files are whole
    write_result(job, claim, result)
    if not (result.interrupted or result.again) and claim.held:
        files.remove(job.folder.path / CHECKPOINT)
    return result


def is_over(job: Job, found: RunInspection) -> bool:
    """Whether the run is over and not to be repeated."""
    return found.state not in UNFINISHED and (not job.outdated or found.stamp != job.outdated)


def transcribed(job: Job, transcriptions: Transcriptions) -> Transcription:
    """Transcribe the job's problem.

    Raises:
        Unavailable: the machine lacks what the job's solver needs. Raised before anything is built where possible.
        SymphysError: the job's backend cannot evaluate what its solver draws.
    """
    backend, wants = job.config.backend, solver(job.config.solver).scenarios
    # a solver that is for all problems uses samples only where the backend can evaluate them
    if job.problem.scenarios is None or not (wants or (wants is None and backend in PRECISIONS)):
        return transcriptions(job)
    if backend not in PRECISIONS:
        raise SymphysError(
            f"the solver {job.config.solver} draws samples of [[scenario]] tables, which the backend {backend} cannot "
            f"evaluate: use {', '.join(list(PRECISIONS)[:-1])} or {list(PRECISIONS)[-1]}"
        )
    try:
        require_kernels(backend)
    except Unavailable as error:
        raise Unavailable(f"{NO_SAMPLES}: {error}") from error
    found = transcriptions(job)
    if found.shooting.scenario is None:
        raise Unavailable(found.backend.note)
    return found


def solve(
    job: Job,
    transcription: Transcription,
    claim: Claim,
    monitor: Monitor,
    log: Callable[[str], None],
    keep: Keep,
    found: RunInspection,
    solved: Outcome | None = None,
    tell: Callable[[str], None] = no_callback,
    bounded: bool = False,
) -> Result:
    """Solve from the seed's guess, or resume from the checkpoint in ``found``; write all files but the result.

    ``solved``: the outcome if seeds were solved side by side; its seconds are those of the group. ``tell`` is called
    with a few words before each part of judging. ``bounded``: whether a limit may kill the process, so that the
    solver's outcome is saved before it is judged.
    """
    chosen = solver(job.config.solver)
    if chosen.by_steps(transcription.shooting):
        transcription = transcription.by_steps
    confirms = partial(confirmed, transcription) if chosen.confirms else None
    finer = partial(finer_shares, transcription) if chosen.confirms else None
    shooting = replace(transcription.shooting, confirms=confirms, finer_errors=finer)
    shooting = replace(shooting, multipliers=job.guess.multipliers)
    log(f"evaluated by {transcription.backend}")
    for note in job.guess.notes:
        log(f"guess from {job.guess.folder}: {note}")
    start = shooting.start(job.config.seed)
    if solved is None:
        single = transcription.backend.precision == "single"
        outcome, spent = solve_alone(job, shooting, start, monitor, log, keep, found.checkpoint, single)
        if doubt := transcription.backend.later():
            log(doubt)
        keep_outcome(job, claim, outcome, spent + spent_before(found), bounded)
    else:
        log("solved side by side with other seeds: the seconds are those of all")
        outcome, spent = solved, solved.trace[-1].seconds if solved.trace else 0.0
    spent += spent_before(found)
    at_once = found.result is not None  # without an earlier result nothing counts before the new one is written
    claim.check()
    began = time.perf_counter()
    keep_guess(job, transcription, start, log, at_once)
    judgement = judge(transcription, outcome, job.examine, tell)
    price = transcription.prices(used(outcome.counts))
    claim.check()
    write(job, transcription, outcome, judgement, price, at_once)
    seconds = {"build": transcription.build_seconds, "compile": transcription.backend.seconds, "solve": spent}
    seconds["judge"] = time.perf_counter() - began
    return make_result(job, transcription, outcome, judgement, price, seconds)


def keep_guess(job: Job, transcription: Transcription, start: Array, log: Callable[[str], None], at_once: bool) -> None:
    """Write the motion of the guess; where its exact rollout is not finite, say so in the log."""
    try:
        motion = transcription.simulate(start)
    except NotFinite as error:
        log(f"the motion of the guess is not kept: {error}")
    else:
        files.write_npz(job.folder.path / GUESS, motion.arrays(), at_once)


def solve_alone(
    job: Job,
    shooting: ShootingProblem,
    start: Array,
    monitor: Monitor,
    log: Callable[[str], None],
    keep: Keep,
    checkpoint: dict[str, Any] | None,
    single: bool,
) -> tuple[Outcome, float]:
    """Return the outcome and the seconds it took; an outcome that the checkpoint holds already is taken from there.

    ``single``: whether gradients are in single precision.
    """
    if checkpoint and OUTCOME in checkpoint:
        log("solved before; what it found is judged")
        return revived_outcome(checkpoint, job.config.solver), 0.0
    chosen = solver(job.config.solver)
    chosen.prepare()
    began = time.perf_counter()
    if single and job.config.solver in DIFFERENTIATING:
        log("comparing the first gradient with double precision")  # by the kernel, see backends.precision
        shooting.evaluator.gradient(start[None], getattr(job.options, "smoothing", (0.0,))[0])
    outcome = chosen.solve(
        shooting, start, job.options, job.config.seed, monitor=monitor, checkpoint=checkpoint, log=log, keep=keep
    )
    return outcome, time.perf_counter() - began


def keep_outcome(job: Job, claim: Claim, outcome: Outcome, seconds: float, bounded: bool) -> None:
    """Save what the solver needs to resume, or, where a limit may end the judging, its outcome."""
    if outcome.status is Status.INTERRUPTED:
        claim.publish(CHECKPOINT, files.json_text(outcome.checkpoint).encode())
    elif bounded:
        kept = plain_outcome(outcome, job.config.solver, seconds)
        claim.publish(CHECKPOINT, files.json_text(kept).encode())


def spent_before(found: RunInspection) -> float:
    """Return the time of solving [s] before the checkpoint; if the process was killed, up to its last iteration."""
    if not found.checkpoint:
        return 0.0
    if found.result:
        return found.result.seconds.get("solve", 0.0)
    seconds = found.checkpoint.get("seconds", 0.0)
    return float(seconds) if isinstance(seconds, int | float) else 0.0


def confirmed(transcription: Transcription, z: Array) -> bool:
    """Whether z solves the problem by a motion that can be relied on.

    With finer time steps and more sweeps it still does, and neither energy nor contacts speak against it.
    """
    verdict = transcription.judge(z)
    if not verdict.solved:
        return False
    rows = list[dict[str, Any]]()
    try:
        for row in trust.finer_values(transcription, z):
            rows.append(row)
            if not holds(Examination.from_json(files.strict({"refined": [row]})), judged(verdict)):
                return False
        found = {**trust.survey(transcription, transcription.record(z)), "refined": rows}
    except NotFinite:  # another evaluator, or finer steps, lead somewhere that no number describes
        return False
    return not doubts(Examination.from_json(files.strict(found)), judged(verdict))


def finer_shares(transcription: Transcription, Z: Array) -> Array:
    """Return (B, k) the errors of ``finer_errors`` as shares of what refutes a result."""
    return trust.finer_errors(transcription, Z, WORST_LIMITS[1]) / WORST_LIMITS[1]


def judge(
    transcription: Transcription, outcome: Outcome, examine: bool = True, tell: Callable[[str], None] = no_callback
) -> Judgement:
    """Roll the solution out exactly and examine it; ``tell`` as in ``solve``."""
    tell(JUDGING)
    counts = outcome.counts
    derived = bool(counts.gradients or counts.jacobians or counts.hessians)
    try:
        taken = transcription.record(outcome.z)  # where steps are compared with the virtual machine's
        verdict = transcription.judge(outcome.z)
        examined: dict[str, Any] | None = None
        if outcome.status is not Status.INTERRUPTED or (verdict.checks and verdict.solved):
            examined = (
                trust.examine(transcription, taken.z, tell, whole=False, slopes=derived, refuted=WORST_LIMITS[1])
                if examine
                else trust.survey(transcription, taken)
            )
    except SymphysError as error:
        return Judgement(None, None, None, f"{outcome.advice} {error}".strip())
    smoothed = outcome.status is Status.MET and not verdict.solved and outcome.trace[-1].smoothing > 0
    well = verdict.solved and outcome.status in (Status.MET, Status.CONVERGED)
    known = Examination.from_json(files.strict(examined or {}))
    found = () if well else obstacles(known, judged(verdict))
    # more iterations do not help where the costs outweigh a target
    rest = "" if found and known.outweighed else outcome.advice or SMOOTHED_ONLY * smoothed
    return Judgement(verdict, taken.motion, examined, sentences([*found, rest]))


def sentences(clauses: list[str]) -> str:
    """Join clauses to sentences, without empty ones; the first keeps its case, and the last has no full stop."""
    known = [clause for clause in clauses if clause]
    return ". ".join([*known[:1], *map(capital, known[1:])])


def write(
    job: Job,
    transcription: Transcription,
    outcome: Outcome,
    judgement: Judgement,
    price: Mapping[str, float],
    at_once: bool,
) -> None:
    """Write trace, gains, motion, scene and multipliers."""
    job.folder.write_trace([trace_row(row, price) for row in outcome.trace], at_once)
    if outcome.gains:
        files.write_npz(job.folder.path / GAINS, outcome.gains, at_once)
    if judgement.trajectory is not None:
        files.write_npz(job.folder.path / TRAJECTORY, judgement.trajectory.arrays(), at_once)
        z = transcription.shooting.by_block(outcome.z)
        scene = make_scene(job.problem, z, judgement.trajectory)
        files.write_json(job.folder.path / SCENE, scene.to_json(), at_once)
        if film := film_of(transcription, outcome):
            files.write_npz(job.folder.path / FILM, film.arrays(), at_once)
    if outcome.multipliers:
        files.write_npz(job.folder.path / MULTIPLIERS, outcome.multipliers, at_once)


def film_of(transcription: Transcription, outcome: Outcome) -> FilmMotions | None:
    """Return exact motions along a solve, side by side, and that of the result; None without any."""
    rollout = transcription.rollout
    count, frames = film_size(len(rollout.world.bodies), len(outcome.film), rollout.steps)
    if count < 2 or not transcription.quick_motions:
        return None
    chosen = [outcome.film[k] for k in np.unique(np.linspace(0, len(outcome.film) - 1, count).round().astype(int))]
    rows = np.array([*(point.row for point in chosen), len(outcome.trace) - 1])
    ticks = np.linspace(0, rollout.steps, frames).round().astype(int)
    return FilmMotions(rows, *transcription.motions(np.array([*(point.z for point in chosen), outcome.z]), ticks))


def write_result(job: Job, claim: Claim, result: Result) -> None:
    """Write result.json unless the run was taken over, and record the run in the table of all runs."""
    found = files.strict(result.to_json())
    claim.publish(RESULT, files.json_text(found).encode())
    Journal(job.folder.path.parents[1]).add(job.folder.path, (files.strict(job.config.to_json()), found))


class Log:
    """The text of log.txt: messages of the solver, line by line; a resumed run appends."""

    def __init__(self, job: Job) -> None:
        """Start with the text of an interrupted run, if there is any."""
        self.path = job.folder.path / LOG
        self.text = ""
        with contextlib.suppress(files.FileError):
            self.text = files.read_text(self.path)

    def __call__(self, line: str) -> None:
        """Add a line."""
        self.text += line.rstrip("\n") + "\n"

    def write(self) -> None:
        """Write the file."""
        files.write_text(self.path, self.text, at_once=False)


class CheckpointKeeper:
    """Saver of checkpoints at intervals, from which a run resumes if its process is killed."""

    def __init__(self, claim: Claim, log: Log, every: float) -> None:
        """Write no checkpoint before ``every`` [s] have passed since the start or the last one."""
        self.claim, self.log, self.every = claim, log, every
        self.due = monotonic() + every

    def __call__(self, make: Callable[[], dict[str, object]]) -> None:
        """Write the offered checkpoint if one is due; a folder that cannot be written is tried again later."""
        began = monotonic()
        if began < self.due:
            return
        try:
            self.claim.publish(CHECKPOINT, files.json_text(make()).encode())
            self.log.write()
        except FolderBusy:
            raise
        except files.FileError as error:
            self.log(f"no checkpoint: {error}")
        self.due = monotonic() + max(self.every, MIN_CHECKPOINT_SPACING * (monotonic() - began))


def stop_at_limit(job: Job, message: str) -> Result:
    """Write that a limit ended the run's process; the result has the best point of the checkpoint to resume from."""

    def stopped() -> Result:
        checkpoint = job.folder.checkpoint()
        if rows := checkpoint_rows(checkpoint):
            job.folder.write_trace(rows)
        return interruption(job, message, checkpoint)

    return write_end(job, stopped) or interruption(job, message, None)


def give_up(job: Job, message: str, again: bool) -> Result:
    """Write that the run failed, and return the ``failure``."""
    failed = failure(job, message, again)
    return write_end(job, lambda: failed) or failed


def write_end(job: Job, make: Callable[[], Result]) -> Result | None:
    """Write how a run ended whose process is gone, and return the result that its folder holds.

    A folder that has a result already is left as it is. A folder in which another process works, or that cannot be
    read, is not touched, and None is returned. The result of ``make`` is returned even where it cannot be written.
    """
    result = None
    with contextlib.suppress(files.FileError), claimed(job.folder.path) as claim:
        found = inspect_run(job)
        if found.result and is_over(job, found):
            return found.result
        if found.state in (RunState.NEW, RunState.CHANGED, RunState.DAMAGED):
            job.folder.begin(job.config, job.problem.text)
        result = make()
        write_result(job, claim, result)
    return result
