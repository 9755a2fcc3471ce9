"""What do thousands of runs cost: what a batch adds to each, finding one among them, their pages?

Runs so small that hardly anything is computed are done as a batch, and in a loop that solves, judges and simulates and
writes nothing; the difference is what the batch adds: claims, folders, files, the table. Then a solve of ``ball_throw``
is copied into thousands of run folders with seeds, settings and objectives of their own. Commands on them run in
processes of their own, as from a shell, first without the rows that are kept beside the folders; pages are made in two
processes. ``SYMPHYS_FSYNC=1`` in the environment lets each file wait for the disk.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from bench import Row, spent

import symphys
from symphys import files
from symphys.batches import Observer, run_batch
from symphys.problem import load_problem
from symphys.report import WantedPages, make_pages, wanted_below, write_batch_report
from symphys.results.config import case_name
from symphys.results.file_names import CONFIG, GUESS, LOG, PROBLEM, RESULT, SCENE, TRACE, TRAJECTORY
from symphys.results.table import Journal, write_table
from symphys.runs import Job, make_jobs
from symphys.runs.execute import judge
from symphys.runs.record import make_result, used
from symphys.solvers import solver
from symphys.transcription import Transcription, transcribe

COLUMNS = {
    "part": "what is done",
    "runs": "of it",
    "wall_s": "seconds of the clock",
    "cpu_s": "seconds of processors",
    "each_ms": "milliseconds of a processor for a run",
    "memory_mb": "most memory of a command, or memory of this process when the last run ends [MB]",
    "size_mb": "what files take [MB]",
}
TINY = """
title = "A tiny problem"
[simulation]
duration = 0.2
dt = 0.02
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1]
[ground]
[[variable]]
name = "throw"
sets = "ball.velocity"
guess = [1, 0, 0]
lower = [-10, -10, 0]
spread = 0.5
[[target]]
name = "is at half a metre"
value = "ball.position[0:2] - [0.5, 0]"
tolerance = 0.01
"""
COMMAND = """
import sys
from symphys.cli import main
from symphys.runs.provenance import peak_memory
main(sys.argv[1:])
print(peak_memory(), file=sys.stderr)
"""
COMMANDS: dict[str, Sequence[str]] = {
    "symphys ls, nothing kept": ("ls",),
    "symphys ls": ("ls",),
    "symphys ls --where objective<1e-6": ("ls", "--where", "objective<1e-6"),
    "symphys ls --csv": ("ls", "--csv"),
    "symphys best --overall": ("best", "--overall"),
}
SEEDS, DRAWN = 100, 20
"""Seeds of a case, and runs whose figures are written as files."""
COPIED = (PROBLEM, TRAJECTORY, GUESS, SCENE, TRACE, LOG)


def rows(quick: bool = False, runs: int = 10_000, pages: int = 2000, sample: int = 500, jobs: int = 2) -> Iterator[Row]:
    """Yield what a batch adds, what commands on many runs take, and what their pages take.

    Args:
        quick: some ten runs of each.
        runs: of the batch, and folders that commands look at.
        pages: that are made.
        sample: runs of each turn of the loop that writes nothing.
        jobs: processes that make pages.
    """
    runs, pages, sample = (20, 4, 5) if quick else (runs, pages, sample)
    yield from added(runs, sample)
    with tempfile.TemporaryDirectory() as place:
        one = symphys.solve("ball_throw", "gradient", folder=Path(place, "one"), backend="casadi", examine=True).folder
        assert one is not None
        yield from finding(one, Path(place, "many"), runs)
        yield from paging(one, Path(place, "paged"), pages, jobs)


class Measured:
    """Times of a block; see ``timed``."""

    wall: float
    cpu: float

    def row(self, part: str, runs: int, **more: float) -> Row:
        """Return the row of the block."""
        row = dict.fromkeys(COLUMNS) | {"part": part, "runs": runs, "wall_s": self.wall, "cpu_s": self.cpu}
        return row | {"each_ms": 1e3 * self.cpu / runs} | more


@contextmanager
def timed() -> Iterator[Measured]:
    """Measure the clock and the processors over a block, in this process and in those that it waits for."""
    found, began, worked = Measured(), perf_counter(), spent()
    yield found
    found.wall, found.cpu = perf_counter() - began, spent() - worked


class MemoryObserver(Observer):
    """An observer of a batch that notes the memory of this process when runs end."""

    resident = 0.0

    def ended(self, job: Job, result: Any, skipped: bool) -> None:
        """Note the memory [MB]."""
        for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
            if line.startswith("VmRSS:"):
                self.resident = int(line.split()[1]) / 1e3


def added(runs: int, sample: int) -> Iterator[Row]:
    """Yield tiny runs in a loop, in a batch, and the batch again when all are done."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "tiny.toml").write_text(TINY, encoding="utf-8")
        problem = load_problem(folder / "tiny.toml")
        made = make_jobs([problem], ["least_squares"], range(runs), {}, folder / "out", examine=False)
        transcription = transcribe(problem, exact=True, threads=1)
        bare(made[:sample], transcription)
        with timed() as loop:
            bare(made[:sample], transcription)
        yield loop.row("tiny runs in a loop that writes nothing", sample)
        observer = MemoryObserver()
        with timed() as batch:
            run_batch(made, 1, observer, lambda problem, exact: transcription)
        yield batch.row("tiny runs in a batch", runs, memory_mb=observer.resident)
        with timed() as again:
            run_batch(made, 1, observer, partial(transcribe, threads=1))
        yield again.row("the same command again", runs)


def bare(jobs: Sequence[Job], transcription: Transcription) -> None:
    """Do runs without anything that a batch adds."""
    shooting = transcription.shooting
    for job in jobs:
        chosen, start = solver(job.config.solver), shooting.start(job.config.seed)
        transcription.simulate(start)
        outcome = chosen.solve(shooting, start, job.options, job.config.seed)
        judgement = judge(transcription, outcome, job.examine)
        make_result(job, transcription, outcome, judgement, transcription.prices(used(outcome.counts)), {})


def copies(folder: Path, out: Path, count: int, names: Sequence[str]) -> list[Path]:
    """Copy a run into so many folders, a hundred seeds a case, with settings and objectives of their own."""
    config, result = (json.loads((folder / name).read_text(encoding="utf-8")) for name in (CONFIG, RESULT))
    found = []
    for number in range(count):
        case, seed = divmod(number, SEEDS)
        settings = {"ground.friction": round(0.2 + 0.001 * case, 3)}
        copy = out / case_name(config["problem"], settings) / f"{config['solver']}-seed{seed}"
        copy.mkdir(parents=True)
        for name in names:
            (copy / name).write_bytes((folder / name).read_bytes())
        files.write_json(copy / CONFIG, {**config, "seed": seed, "settings": settings})
        objective = result["objective"] * (1 + 1e-6 * number)
        files.write_json(copy / RESULT, {**result, "seed": seed, "objective": objective})
        found.append(copy)
    return found


def finding(one: Path, out: Path, count: int) -> Iterator[Row]:
    """Yield what commands on many runs take, the journal and the table."""
    folders = copies(one, out, count, (PROBLEM, TRACE, LOG))
    for name, arguments in COMMANDS.items():
        call = [sys.executable, "-P", "-c", COMMAND, *arguments, str(out)]
        with timed() as command:
            done = subprocess.run(call, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=True)
        yield command.row(name, count, memory_mb=int(done.stderr.split()[-1]) / 1e6)
    journal, some = Journal(out), folders[:1000]
    with timed() as adding:
        for each in some:
            journal.add(each)
    yield adding.row("rows of runs that end", len(some))
    with timed() as table:
        write_table(out)
    yield table.row("runs.csv and runs.parquet", count)


def paging(one: Path, out: Path, count: int, jobs: int) -> Iterator[Row]:
    """Yield what pages with figures and pages alone take, and the page of the batch."""
    copies(one, out, count, COPIED)
    every = wanted_below(out)
    for figures, chosen in ((True, every.runs[:DRAWN]), (False, every.runs)):
        with timed() as making:
            made = make_pages(WantedPages(every.root, chosen, batch=False), jobs, figures=figures).runs
        pages = [*made, *(path for page in made if figures for path in (page.parent / "figures").iterdir())]
        name = "pages with figures" if figures else "pages"
        yield making.row(f"{name} in {jobs} processes", len(made), size_mb=megabytes(pages))
    with timed() as block:
        page = write_batch_report(out)
    yield block.row("page of the batch", count, size_mb=megabytes([page]))


def megabytes(paths: Sequence[Path]) -> float:
    """Return what files take together [MB]."""
    return sum(path.stat().st_size for path in paths) / 1e6
