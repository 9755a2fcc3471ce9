"""A batch that is done elsewhere: an engine starts drivers, and this process follows what they do and computes nothing.

What comes of a run is read from its folder. News come from the board, see ``symphys.batches.engines.board``.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from symphys import files
from symphys.batches.batch import BatchResult, plan
from symphys.batches.engines import Engine, EngineError, open_engine
from symphys.batches.engines.board import NOTE, OVER, RESUMED, Board
from symphys.batches.engines.driver import DriverTask
from symphys.batches.ledger import Ledger, Observer
from symphys.batches.limits import UNLIMITED, BatchLimits, Halt
from symphys.interrupts import Interrupts
from symphys.results.file_names import RESULT
from symphys.results.result import Result, read_result
from symphys.runs.claim import holder, is_over
from symphys.runs.execute import give_up
from symphys.runs.folder import RunFolder
from symphys.runs.job import Job
from symphys.runs.record import failure
from symphys.runs.standing import Stands, standing
from symphys.runs.transcription_cache import Transcribe

TICK = 0.25
"""[s] between two looks, at least."""
SHARE = 20
"""Looking takes at most one of so many seconds."""
MOST_ROUNDS = 3
"""How often drivers are started again while no run comes to its end."""
GRACE = 5.0
"""[s] that drivers have to end by themselves when nothing is left, and their runs when the time of the batch is up."""


def run_on(
    engine: str,
    scheduler: str,
    jobs: Sequence[Job],
    drivers: int,
    observer: Observer,
    transcribe: Transcribe,
    out: Path,
    limits: BatchLimits = UNLIMITED,
    rerun: str = "",
) -> BatchResult:
    """``run_batch`` by so many drivers that an engine starts.

    ``engine``, ``scheduler``: see ``open_engine``. ``out``: the folder of the batch; all machines see it by one path.

    Raises:
        EngineError: the engine cannot be used.
        FileError: ``out`` cannot be written.
    """
    ledger = Ledger(jobs, observer)
    with Interrupts().listening() as stop:
        halt = Halt(stop, limits.budget)
        waiting = plan(jobs, ledger, rerun)
        if waiting:
            follow(engine, scheduler, waiting, drivers, ledger, transcribe, out.absolute(), limits, halt)
    left = any(result is None or result.interrupted for result in ledger.results)
    return BatchResult(tuple(ledger.results), stop.requested, halt.spent and left)


def follow(
    name: str,
    scheduler: str,
    waiting: list[tuple[int, Job]],
    drivers: int,
    ledger: Ledger,
    transcribe: Transcribe,
    out: Path,
    limits: BatchLimits,
    halt: Halt,
) -> None:
    """Open the engine, let it do what waits, and put all away that was needed for that."""
    sent = tuple(replace(job, folder=RunFolder(job.folder.path.absolute())) for _, job in waiting)
    with contextlib.ExitStack() as stack:
        engine = open_engine(name, scheduler, min(drivers, len(sent)), out)
        stack.callback(engine.close)
        board = Board.hang(out)
        stack.callback(board.take_down)
        task = DriverTask(board, sent, transcribe, replace(limits, budget=float("inf")))
        follower = Follower(task, engine, drivers, [index for index, _ in waiting], ledger, halt)
        follower.run()
        follower.part()


@dataclass
class Follower:
    """Follows the drivers of a batch.

    Attributes:
        task: what each driver does, with the runs that were sent.
        engine: starts drivers.
        drivers: how many are wanted.
        indices: (runs that were sent) of each in the ledger.
        left: those that were sent and are not over.
        at_work: those of them that were begun.
        tried_by: the drivers that have begun each.
        rounds: how often drivers were started again since a run was over.
        turn: drivers that were started.
        told: what has ended drivers; each is said once.
    """

    task: DriverTask
    engine: Engine
    drivers: int
    indices: list[int]
    ledger: Ledger
    halt: Halt
    left: set[int] = field(default_factory=set)
    at_work: set[int] = field(default_factory=set)
    tried_by: dict[int, set[str]] = field(default_factory=dict)
    rounds: int = -1
    turn: int = 0
    told: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Nothing has begun."""
        self.left = set(range(len(self.indices)))

    def run(self) -> None:
        """Follow until all is over, nobody works any more, or a halt has stopped those who did."""
        asked = False
        while self.left:
            began = time.monotonic()
            if self.halt() and not asked:
                asked = True
                self.task.board.stop(self.halt.reason)
            alive = self.engine.alive()
            self.take_news()
            self.bury()
            if not (self.wind_down(alive) if asked else self.keep_up(alive)):
                break
            self.wait(max(TICK, (SHARE - 1) * (time.monotonic() - began)), asked)
        self.sweep(asked)

    def wait(self, seconds: float, asked: bool) -> None:
        """Wait for the next look; not after a halt that is new."""
        until = time.monotonic() + seconds
        while (rest := until - time.monotonic()) > 0 and (asked or not self.halt()):
            time.sleep(min(TICK, rest))

    def take_news(self) -> None:
        """Read what drivers have left on the board."""
        for news in self.task.board.news():
            if news.what == NOTE:
                self.ledger.note(news.text)
            elif news.index not in self.left:
                continue
            elif news.what == OVER:
                self.end(news.index, outcome(self.task.jobs[news.index]))
            else:
                self.at_work.add(news.index)
                self.tried_by.setdefault(news.index, set()).add(news.by)
                self.ledger.started(self.indices[news.index], news.what == RESUMED)

    def end(self, index: int, result: Result) -> None:
        """A run is over."""
        self.left.discard(index)
        self.at_work.discard(index)
        self.rounds = min(self.rounds, 0)
        self.ledger.ended(self.indices[index], result)

    def bury(self) -> None:
        """Give up runs of which one driver more has died than they may be tried again."""
        most = max(self.task.limits.retries, 1)
        for index in [index for index in self.at_work if len(self.tried_by[index]) > most]:
            if died := self.deserted(index):
                self.give_up(index, f"{died} died, as did others at this run before: see log.txt there")

    def deserted(self, index: int) -> str:
        """Whose claim it is that is left on a run at which nobody works any more; empty if there is none."""
        found = holder(self.task.jobs[index].folder.path)
        return str(found[1]) if found and is_over(*found) else ""

    def give_up(self, index: int, message: str) -> None:
        """Write that a run failed, so that no driver takes it up, unless one has already."""
        self.task.board.tell(OVER, index)
        if self.deserted(index):
            self.end(index, give_up(self.task.jobs[index], message, again=True))
        else:
            self.task.board.take_back(index)

    def keep_up(self, alive: int) -> bool:
        """Start drivers in the place of those that ended while runs are left; False if there is none any more."""
        for fault in self.engine.faults():
            if fault not in self.told:
                self.told.add(fault)
                self.ledger.note(f"a driver ended: {fault}")
        missing = min(self.drivers, len(self.left)) - alive
        if missing <= 0:
            return True
        if self.rounds >= MOST_ROUNDS:
            return alive > 0
        self.rounds += 1
        for _ in range(missing):
            first = self.turn * len(self.indices) // self.drivers % len(self.indices)
            try:
                self.engine.start(replace(self.task, first=first))
            except EngineError as error:
                if not self.turn:
                    raise
                self.ledger.note(f"no more drivers start: {error}")
                break
            self.turn += 1
        return True

    def wind_down(self, alive: int) -> bool:
        """After a halt: whether to wait for runs to stop; the rest of the drivers is not waited for.

        After Ctrl-C a run may take its time, since a second one ends it. The time of the batch is a limit.
        """
        return bool(alive and self.at_work) and self.halt.overdue < GRACE

    def sweep(self, asked: bool) -> None:
        """Take what is in the folders of runs of which no news came; say what is missing."""
        for index in sorted(self.left):
            found = standing(self.task.jobs[index])
            fresh = found.stamp != self.task.jobs[index].outdated
            if found.result and fresh and (index in self.at_work or not found.missing()):
                self.end(index, found.result)
        if self.left and not asked:
            self.ledger.note(
                f"no driver is left, and {len(self.left)} of {len(self.indices)} runs are not done; the same command "
                "does the rest"
            )

    def part(self) -> None:
        """Let drivers that find nothing more end by themselves."""
        self.task.board.stop(self.halt.reason)
        until = time.monotonic() + GRACE
        while self.engine.alive() and time.monotonic() < until:
            time.sleep(TICK / 5)


def outcome(job: Job) -> Result:
    """What a run that is over has come to, as its folder says."""
    found = standing(job)
    try:
        if found.result is None and found.stands in (Stands.LOST, Stands.HALFWAY):
            return read_result(job.folder.path / RESULT)
    except files.FileError as error:
        return failure(job, str(error), again=True)
    return found.result or failure(job, f"its driver could not write what it came to: {found.why}", again=True)
