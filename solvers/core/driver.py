"""The driver of a solve: runs stages and the loop of a method, records iterations, keeps the checkpoint.

A method has ``init``, ``step`` and ``terminate``, see ``interface.Method``. Interruption and going on, limits of the
solve, the errors of foreign code, the trace and continuation are here, the same for all.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, astuple, replace
from typing import Any, TypeVar

import numpy as np

from symphys.records import dataclass
from symphys.shooting import ShootingProblem
from symphys.solvers.core.checkpoint import Checkpoint, from_plain, to_plain
from symphys.solvers.core.continuation import Rate, exact_best, stage_result
from symphys.solvers.core.evaluator import CountingEvaluator, WorkCounter
from symphys.solvers.core.film import FilmRecorder
from symphys.solvers.core.interface import Iteration, IterationRecorder, Log, Method, Solver, StageContext, nothing
from symphys.solvers.core.options import SolverOptions
from symphys.solvers.core.outcome import Counts, Keep, Monitor, Outcome, StageResult, Status, StopReason, TraceRow
from symphys.solvers.core.point import Incumbent, Point, Stop
from symphys.types import Array


class SolveTrace:
    """The iterations of a solve and their times, interruptions left out."""

    def __init__(self, rows: Iterable[TraceRow] = (), seconds: float = 0.0) -> None:
        """Start the clock; ``rows`` and ``seconds``: those of a resumed solve."""
        self._rows = list(rows)
        self._earlier, self._began = seconds, time.perf_counter()

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self._rows)

    @property
    def rows(self) -> tuple[TraceRow, ...]:
        """All rows."""
        return tuple(self._rows)

    @property
    def last(self) -> TraceRow | None:
        """The last row; None before the first one."""
        return self._rows[-1] if self._rows else None

    @property
    def seconds(self) -> float:
        """The time [s] since the solve began, interruptions left out."""
        return self._earlier + time.perf_counter() - self._began

    def append(self, counts: Counts, numbers: Iterable[float], outputs: Mapping[str, float]) -> TraceRow:
        """Add an iteration that ends now; ``numbers``: objective to smoothing, in the order of ``TraceRow``."""
        row = TraceRow(*(len(self), *astuple(counts), self.seconds, *numbers, dict(outputs)))
        self._rows.append(row)
        return row

    def distribute(self, work: Counts, first: int) -> None:
        """Add work evenly to the rows from ``first`` on, for a library that reports it only at its end."""
        share = len(self) - first
        for index in range(first, len(self)):
            row, part = self._rows[index], work.share((index - first + 1) / share)
            self._rows[index] = replace(row, **asdict(counts_of(row) + part))


def counts_of(row: TraceRow) -> Counts:
    """Return the work up to a row."""
    return Counts(row.rollouts, row.gradients, row.jacobians, row.hessians)


FINISHED_STATE: dict[str, object] = {}
"""The state of a stage that is complete."""
INTERRUPTED = "interrupted; with its checkpoint the solve goes on from here"

O_inv = TypeVar("O_inv", bound=SolverOptions)
StateT = TypeVar("StateT")
Stage = Callable[[StageContext, O_inv, "dict[str, object] | None", IterationRecorder], StopReason]
"""Runs one stage from its start, or from the saved state of a method that is resumed."""


def refuse_none(problem: ShootingProblem) -> str:
    """Return no reason: the solver is for every problem."""
    return ""


def rate_by_rollout(options: object, seed: int) -> Rate:
    """Return a ``Rate`` by one rollout for each point."""
    return CountingEvaluator.rate


def stage_of(method: Callable[[StageContext, O_inv], Method[Any]]) -> Stage[O_inv]:
    """Make a stage that runs the loop of a method."""

    def stage(
        context: StageContext, options: O_inv, saved: dict[str, object] | None, recorder: IterationRecorder
    ) -> StopReason:
        return iterate(method(context, options), saved, recorder)

    return stage


def iterate(method: Method[StateT], saved: dict[str, object] | None, recorder: IterationRecorder) -> StopReason:
    """Run the loop of a method: ``init``, then ``step`` until ``terminate``."""
    if saved:
        state = method.resume(saved)
    else:
        first = method.init()
        if isinstance(first, StopReason):
            return first
        recorder.commit(first)
        state = first.state
    while True:
        reason = method.terminate(state)
        if reason is not None:
            return reason
        spent = recorder.spent()
        if spent is not None:
            return method.conclude(state, spent)
        following = method.step(state)
        if isinstance(following, StopReason):
            return following
        recorder.commit(following)
        state = following.state


MakeGains = Callable[[ShootingProblem, Array, float], Mapping[str, Array]]
"""(problem, z (n,), smoothing) -> the gains of an outcome."""


def without_feedback(problem: ShootingProblem, z: Array, smoothing: float) -> Mapping[str, Array]:
    """Return no gains, for solvers that find no feedback."""
    return {}


def make_solver(
    name: str,
    summary: str,
    Options: type[O_inv],
    stage: Stage[O_inv],
    *,
    check: Callable[[O_inv], None] = lambda options: None,
    refusal: Callable[[ShootingProblem], str] = refuse_none,
    rate: Callable[[O_inv, int], Rate] = rate_by_rollout,
    constraints: bool = False,
    prepare: Callable[[], object] = nothing,
    threaded: bool = False,
    scenarios: bool | None = False,
    feedback: MakeGains = without_feedback,
    by_steps: bool = False,
) -> Solver[O_inv]:
    """Make a solver from its parts; parameters that are not described here are fields of ``Solver``.

    ``stage`` runs one stage of smoothing, see ``stage_of``. ``check`` raises SymphysError for options that cannot be
    passed to a library. ``refusal`` returns why the solver is not for a problem, or nothing. ``rate`` makes, from
    options and seed, what compares the points of several stages. ``constraints``: whether violated constraints come
    before the merit in the comparison of points. ``feedback`` makes the gains of the outcome.
    """

    def solve(
        problem: ShootingProblem,
        start: Array,
        options: O_inv,
        seed: int = 0,
        monitor: Monitor | None = None,
        checkpoint: dict[str, object] | None = None,
        log: Log | None = None,
        keep: Keep | None = None,
    ) -> Outcome:
        """Solve as ``interface.Solve`` has it."""
        check(options)
        if by_steps and problem.by_steps is not None:
            problem = replace(problem, evaluator=problem.by_steps)

        def run_stage(
            context: StageContext, saved: dict[str, object] | None, recorder: IterationRecorder
        ) -> StopReason:
            refused = refusal(problem)
            if refused:
                return StopReason(Status.NOT_APPLICABLE, refused)
            return stage(context, options, saved, recorder)

        request = Request(
            name, problem, start, options, seed, monitor, checkpoint, log or ignore_log, constraints, keep, feedback
        )
        return Driver(request, run_stage, rate(options, seed)).run()

    return Solver(name, summary, Options, solve, prepare, threaded, scenarios, lambda problem: by_steps)


@dataclass(frozen=True)
class Request:
    """The arguments of a solve; see ``interface.Solve``.

    Attributes:
        solver: its name.
        problem, start, seed, monitor, checkpoint, log, keep: of the call.
        options: of the call; of these the driver knows the limits.
        constraints, feedback: see ``make_solver``.
    """

    solver: str
    problem: ShootingProblem
    start: Array
    options: SolverOptions
    seed: int
    monitor: Monitor | None
    checkpoint: dict[str, object] | None
    log: Log
    constraints: bool
    keep: Keep | None = None
    feedback: MakeGains = without_feedback


class Driver:
    """One solve from start to outcome; the ``IterationRecorder`` of its stages."""

    def __init__(
        self,
        request: Request,
        stage: Callable[[StageContext, dict[str, object] | None, IterationRecorder], StopReason],
        rate: Rate,
    ) -> None:
        """Prepare a solve."""
        problem = request.problem
        self._request, self._stage, self._rate = request, stage, rate
        self._evaluator = CountingEvaluator(
            problem, problem.smoothing[0], self._incumbent(problem.smoothing[0]), constraints=request.constraints
        )
        self._start = self._evaluator.clip(np.array(request.start, float))
        self._trace, self._film = SolveTrace(), FilmRecorder()
        self._last: Array | None = None
        self._stages: tuple[StageResult, ...] = ()
        self._checkpoint: Checkpoint | None = None
        self._multipliers: Mapping[str, Array] = {}

    def run(self) -> Outcome:
        """Run every stage; failures become a status with advice, and SymphysError alone passes through."""
        try:
            reason, z = self._run_stages()
        except KeyboardInterrupt as stopped:
            reason = StopReason(Status.INTERRUPTED, str(stopped) or INTERRUPTED)
            z = self._stages[-1].z if self._stages else self._start
        self._request.log(str(reason))
        if reason.status is Status.INTERRUPTED and self._checkpoint is not None:
            return self._interrupted(reason, self._checkpoint)
        multipliers = self._multipliers if reason.status in (Status.MET, Status.CONVERGED) else {}
        return Outcome(
            reason.status,
            reason.advice,
            z,
            self._trace.rows,
            self._evaluator.counter.counts,
            {},
            self._stages,
            self._gains(reason.status, z),
            multipliers,
            tuple(self._film.points),
        )

    def _gains(self, status: Status, z: Array) -> Mapping[str, Array]:
        """Return feedback gains about the solution z (n,); none where the solve or foreign code failed."""
        if status.fatal or status is Status.INTERRUPTED:
            return {}
        try:
            return self._request.feedback(self._request.problem, z, self._request.problem.smoothing[-1])
        except (RuntimeError, ArithmeticError, np.linalg.LinAlgError, MemoryError) as error:
            self._request.log(f"no feedback gains: {str(error).strip() or type(error).__name__}")
            return {}

    def commit(self, iteration: Iteration[Any]) -> None:
        """Implement ``IterationRecorder.commit``."""
        point, evaluator, names = iteration.point, self._evaluator, self._request.problem.output_names
        if point is None:
            return
        best, counts = evaluator.incumbent.best or point, evaluator.counter.counts
        numbers = (point.objective, best.objective, point.max_violation, iteration.gradient_norm, iteration.step)
        outputs = {**dict(zip(names, best.outputs.tolist(), strict=False)), **iteration.outputs}
        row = self._trace.append(counts, (*numbers, evaluator.smoothing), outputs)
        self._last = point.z
        self._film.add(row.iteration, point.z)
        self._checkpoint = taken = Checkpoint(
            self._stages, iteration.state, best, point.z, counts, len(self._trace), row.seconds
        )
        if self._request.keep:
            self._request.keep(lambda: to_plain(self._request.solver, taken, self._trace.rows))
        if self._request.monitor:
            self._request.monitor(row)

    def spent(self) -> StopReason | None:
        """Implement ``IterationRecorder.spent``."""
        row = self._trace.last
        reason = self._request.options.spent(row) if row else None
        return reason and replace(reason, whole=True)

    def distribute(self, work: Counts, first: int) -> None:
        """Implement ``IterationRecorder.distribute``."""
        self._trace.distribute(work, first)
        self._evaluator.counter.add(work)
        if self._checkpoint:
            last = self._trace.rows[self._checkpoint.rows - 1]
            self._checkpoint = replace(self._checkpoint, counts=counts_of(last))

    def multipliers(self, found: Mapping[str, Array]) -> None:
        """Implement ``IterationRecorder.multipliers``."""
        self._multipliers = found

    @property
    def rows(self) -> int:
        """Implement ``IterationRecorder.rows``."""
        return len(self._trace)

    def _run_stages(self) -> tuple[StopReason, Array]:
        """Run all stages in order; return why the last one ended, and the solution (n,)."""
        z, saved = self._resume()
        reason, smoothings = StopReason(Status.MET), self._request.problem.smoothing
        for index, smoothing in enumerate(smoothings[len(self._stages) :], len(self._stages)):
            if saved is None:
                self._evaluator = self._evaluator.at(smoothing, self._incumbent(smoothing))
                self._last = None
            self._request.log(f"stage {index + 1} of {len(smoothings)}: smoothing {smoothing:g}")
            reason = StopReason(Status.MET) if saved == FINISHED_STATE else self._run_stage(z, saved)
            status, best = reason.status, self._evaluator.incumbent.best
            z, saved = (best.z if best else z), None
            solution, over = z, reason.whole or status.fatal or index + 1 == len(smoothings)
            if over:
                reason, solution = exact_best(self._evaluator, self._rate, self._start, self._stages, z, reason)
            total = self._evaluator.counter.counts, self._trace.seconds
            self._stages += (stage_result(smoothing, status, z, best, total, self._stages),)
            if over:
                return reason, solution
            self._request.log(str(reason))
        return reason, z

    def _incumbent(self, smoothing: float, best: Point | None = None) -> Incumbent:
        """Return the incumbent of a stage; only what is met exactly can be confirmed."""
        problem = self._request.problem
        return Incumbent(problem.stop_when_met, best, None if smoothing else problem.confirms)

    def _resume(self) -> tuple[Array, dict[str, object] | None]:
        """Return the start of the next stage, and the saved state of its method if the solve is resumed."""
        request = self._request
        if not request.checkpoint:
            return self._start, None
        checkpoint, saved, rows = from_plain(request.checkpoint, request.solver, request.problem)
        self._checkpoint, self._stages, self._last = checkpoint, checkpoint.stages, checkpoint.last
        self._trace = SolveTrace(rows, checkpoint.seconds)
        best = replace(checkpoint.best, violation=self._evaluator.violation(checkpoint.best.errors))
        smoothing = request.problem.smoothing[len(self._stages)]
        self._evaluator = replace(
            self._evaluator,
            smoothing=smoothing,
            incumbent=self._incumbent(smoothing, best),
            counter=WorkCounter(checkpoint.counts),
        )
        return self._stages[-1].z if self._stages else self._start, saved

    def _run_stage(self, z: Array, saved: dict[str, object] | None) -> StopReason:
        """Run a stage; errors of foreign code and of memory become a reason."""
        context = StageContext(self._evaluator, z, self._request.seed, self._request.log)
        try:
            try:
                return self._stage(context, saved, self)
            except Stop as stop:
                self._commit_incumbent()
                return stop.reason
        except (RuntimeError, ArithmeticError, np.linalg.LinAlgError, MemoryError) as error:
            text = str(error).strip() or type(error).__name__
            return StopReason(Status.FAILED, f"{self._request.solver} failed: {text}")

    def _commit_incumbent(self) -> None:
        """Record a row for the point that ended a stage within an iteration."""
        best = self._evaluator.incumbent.best
        if best is not None:
            before = best.z if self._last is None else self._last
            self.commit(Iteration(FINISHED_STATE, best, step=float(np.linalg.norm(best.z - before))))

    def _interrupted(self, reason: StopReason, checkpoint: Checkpoint) -> Outcome:
        """Return the outcome at the end of the last complete iteration, with the checkpoint to resume from."""
        request, before, best = self._request, checkpoint.stages, checkpoint.best
        rows = self._trace.rows[: checkpoint.rows]
        halfway = stage_result(
            request.problem.smoothing[len(before)],
            reason.status,
            best.z,
            best,
            (checkpoint.counts, checkpoint.seconds),
            before,
        )
        saved = to_plain(request.solver, checkpoint, rows)
        film = tuple(point for point in self._film.points if point.row < len(rows))
        stages = (*before, halfway)
        return Outcome(reason.status, reason.advice, best.z, rows, checkpoint.counts, saved, stages, film=film)


def ignore_log(line: str) -> None:
    """Drop a line of the log."""
