"""Seconds and megabytes of the pages of a large batch.

    python benchmarks/report_pages.py [RUNS] [JOBS]

Ball throws of twenty seeds are solved and copied into RUNS folders (2,000 without a number), with seeds and objectives
of their own. Pages are then made in JOBS processes (2). The page of the batch is made by itself.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from time import perf_counter

import symphys
from symphys import files
from symphys.report import WantedPages, make_pages, wanted_below, write_batch_report
from symphys.results.file_names import CONFIG, GUESS, LOG, PROBLEM, RESULT, SCENE, TRACE, TRAJECTORY

ORIGINALS = 20
FULL = 20
"""Full pages are timed on so many."""
COPIED = (PROBLEM, TRAJECTORY, GUESS, SCENE, TRACE, LOG)


def main() -> None:
    """A line for each kind of page."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    jobs = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        symphys.solve_all(["ball_throw"], ["least_squares"], seeds=ORIGINALS, folder=root / "originals")
        copy(sorted((root / "originals" / "ball_throw").iterdir()), root / "batch" / "ball_throw", runs)
        few = WantedPages(root / "originals", wanted_below(root / "originals").runs[:FULL], batch=False)
        measured("full", few, "full", jobs)
        every = wanted_below(root / "batch")
        measured("light", WantedPages(every.root, every.runs, batch=False), "light", jobs)
        began, worked = perf_counter(), processor_seconds()
        page = write_batch_report(root / "batch")
        took = f"{perf_counter() - began:.1f} s ({processor_seconds() - worked:.1f} s of processors)"
        print(f"page of the batch of {runs} runs: {took}, {megabytes([page]):.2f} MB")


def copy(originals: list[Path], into: Path, runs: int) -> None:
    """Run folders that differ in their seeds and objectives."""
    for seed in range(runs):
        source, folder = originals[seed % len(originals)], into / f"least_squares-seed{seed}"
        folder.mkdir(parents=True)
        for name in COPIED:
            (folder / name).write_bytes((source / name).read_bytes())
        for name in (RESULT, CONFIG):
            found = json.loads((source / name).read_text(encoding="utf-8")) | {"seed": seed}
            if name == RESULT:
                found["objective"] *= 1 + 1e-6 * seed
            files.write_json(folder / name, found)


def measured(name: str, wanted: WantedPages, kind: str, jobs: int) -> None:
    """Make pages, and say what they took."""
    began, worked = perf_counter(), processor_seconds()
    made = make_pages(wanted, kind, jobs)
    seconds, worked, count = perf_counter() - began, processor_seconds() - worked, len(made.runs)
    size = megabytes([path for page in made.runs for path in (page, *(page.parent / "figures").glob("*"))])
    took = f"{seconds:.1f} s ({worked:.1f} s of processors), {size:.1f} MB"
    each = f"{1000 * worked / count:.0f} ms and {1000 * size / count:.0f} kB each"
    print(f"{count} {name} pages in {jobs} processes: {took}; {each}", flush=True)


def processor_seconds() -> float:
    """That this process and those that it has waited for have used [s]."""
    return sum(used.ru_utime + used.ru_stime for used in map(getrusage, (RUSAGE_SELF, RUSAGE_CHILDREN)))


def megabytes(paths: list[Path]) -> float:
    """What files take together [MB]."""
    return sum(path.stat().st_size for path in paths) / 1e6


if __name__ == "__main__":
    main()
