"""What a batch adds to each of thousands of runs: claims, folders, files, the table; and what stays in memory.

The same runs are done twice, of a problem so small that hardly anything is computed: as a batch, and in a loop that
solves, judges and simulates and writes nothing. The difference is what the batch adds.

    python benchmarks/overhead.py --runs 10000
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

from symphys.batches import Observer, run_batch
from symphys.problem import load_problem
from symphys.results.table import read_rows
from symphys.runs import Job, make_jobs
from symphys.runs.execute import judge
from symphys.runs.record import make_result, used
from symphys.solvers import solver
from symphys.transcription import Transcription, transcribe

PROBLEM = """
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


class Memory(Observer):
    """An observer that notes the memory of this process [MB] at every hundredth end."""

    def __init__(self) -> None:
        """Nothing has ended."""
        self.ended_runs, self.seen = 0, [resident()]

    def ended(self, job: Job, result: Any, skipped: bool) -> None:
        """Note the memory now and then."""
        self.ended_runs += 1
        if self.ended_runs % 100 == 0:
            self.seen.append(resident())


def resident() -> float:
    """[MB] that this process has in memory."""
    for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1e3
    return float("nan")


class Clock:
    """Wall time and processor time [s] since it was made."""

    def __init__(self) -> None:
        """Now."""
        self.began = time.perf_counter(), time.process_time()

    @property
    def times(self) -> tuple[float, float]:
        """Until now; reading waits for the disk, so the first is the longer."""
        return time.perf_counter() - self.began[0], time.process_time() - self.began[1]


def bare(jobs: list[Job], transcription: Transcription) -> tuple[float, float]:
    """Times of a run without anything that a batch adds."""
    shooting, clock = transcription.shooting, Clock()
    for job in jobs:
        chosen, start = solver(job.config.solver), transcription.shooting.start(job.config.seed)
        transcription.simulate(start)
        outcome = chosen.solve(shooting, start, job.options, job.config.seed)
        judgement = judge(transcription, outcome, job.examine)
        make_result(job, transcription, outcome, judgement, transcription.prices(used(outcome.counts)), {})
    wall, processor = clock.times
    return wall / len(jobs), processor / len(jobs)


def main(given: list[str] | None = None) -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--sample", type=int, default=500, help="runs of each turn of the loop that writes nothing")
    asked = parser.parse_args(given)
    with tempfile.TemporaryDirectory(prefix="symphys-overhead-") as temporary:
        folder = Path(temporary)
        (folder / "tiny.toml").write_text(PROBLEM, encoding="utf-8")
        problem = load_problem(folder / "tiny.toml")
        jobs = make_jobs([problem], ["least_squares"], range(asked.runs), {}, folder / "out", examine=False)
        made = partial(transcribe, threads=1)
        transcription = made(problem, True)
        bare(jobs[: asked.sample], transcription)
        before = bare(jobs[: asked.sample], transcription)
        memory, clock = Memory(), Clock()
        batch = run_batch(jobs, 1, memory, lambda problem, exact: transcription)
        whole, flat = clock.times, list(memory.seen)
        after = bare(jobs[: asked.sample], transcription)
        clock = Clock()
        run_batch(jobs, 1, memory, made)
        again, clock = clock.times, Clock()
        rows = read_rows(folder / "out").rows
        listed = clock.times
    print(f"{asked.runs} runs, {sum(result is not None and result.solved for result in batch.results)} solved")
    for word, total, first, second in zip(("wall time", "processor"), whole, before, after, strict=True):
        each, share = total / asked.runs, (first + second) / 2
        print(
            f"{word}: a run takes {1e3 * each:.1f} ms in a batch and {1e3 * share:.1f} ms without "
            f"({1e3 * first:.1f} before it, {1e3 * second:.1f} after): the batch adds {1e3 * (each - share):.1f} ms"
        )
    tenth = flat[max(len(flat) // 10, 1)]
    print(f"memory: {tenth:.0f} MB after a tenth of the runs, {flat[-1]:.0f} MB when the last ends")
    print(f"the same command again: {again[0]:.1f} s; the table of {len(rows)} runs: {listed[0]:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
