"""Discovery of run folders below a folder, grouped by problem and solver."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from symphys.findings.verdict import BEST_FOUND, DOUBTED, SOLVED
from symphys.records import dataclass
from symphys.results.config import settings_words
from symphys.results.file_names import CONFIG, FIGURES, PROBLEM, RESULT
from symphys.results.run import Run, read_run
from symphys.results.text_files import ReportError

RANKS = {word: rank for rank, word in enumerate((SOLVED, BEST_FOUND, DOUBTED))}
"""Ranks of verdicts; others come last."""


def middle(numbers: Sequence[float]) -> float:
    """Return the median; halves are added, since a sum may exceed the largest double."""
    return 2 * float(np.median(np.asarray(numbers, float) / 2))


@dataclass(frozen=True)
class Entry:
    """The runs of one solver on one problem, by seed."""

    solver: str
    runs: tuple[Run, ...]

    @property
    def solved(self) -> int:
        """Return how many runs are solved."""
        return sum(run.solved for run in self.runs)

    def median(self, numbers: list[float]) -> float:
        """Return the median of the finite numbers; nan without any."""
        finite = [number for number in numbers if np.isfinite(number)]
        return middle(finite) if finite else np.nan


@dataclass(frozen=True)
class Study:
    """The runs of one problem in one place."""

    problem: str
    place: str
    entries: tuple[Entry, ...]

    @property
    def runs(self) -> tuple[Run, ...]:
        """Return the runs of all solvers."""
        return tuple(run for entry in self.entries for run in entry.runs)

    @property
    def title(self) -> str:
        """Return the problem's title."""
        return self.runs[0].title

    @property
    def settings(self) -> str:
        """Write what the command line changed in the problem's file; empty if nothing."""
        return settings_words(self.runs[0].settings)

    @property
    def best(self) -> Run:
        """Return the best run by its verdict, then the lowest objective, then the lowest cost."""

        def merit(run: Run) -> tuple[int, float, float]:
            known = [np.inf if np.isnan(number) else number for number in (run.objective, run.equivalents)]
            return RANKS.get(run.verdict, len(RANKS)), known[0], known[1]

        return min(self.runs, key=merit)


def run_folders(root: Path) -> list[Path]:
    """List the folders at or below ``root`` that look like run folders, in order of name. Raises ReportError."""
    if not root.is_dir():
        raise ReportError(f"{root}: there is no such folder; give one that `symphys solve --out` has written")
    found = []
    for folder, below, files in os.walk(root):
        below[:] = sorted(name for name in below if name != FIGURES and not name.startswith("."))
        if is_run(files):
            found.append(Path(folder))
    return found


def is_run_folder(folder: Path) -> bool:
    """Whether there is a run folder, finished or not."""
    return folder.is_dir() and is_run([path.name for path in folder.iterdir()])


def is_run(files: list[str]) -> bool:
    """Whether a folder with these files is a run folder, finished or not."""
    return RESULT in files or (CONFIG in files and PROBLEM in files)


def read_all(root: Path, read: Callable[[Path], Run] | None = None) -> tuple[list[Run], list[Run]]:
    """Return runs with a result, and folders without a readable one; ``read``: ``read_run``, or a ``BriefReader``."""
    runs = [read(folder) if read else read_run(folder, root) for folder in run_folders(root)]
    return [run for run in runs if run.readable], [run for run in runs if not run.readable]


def studies(runs: Sequence[Run]) -> list[Study]:
    """Group runs: same problem and same parent folder make one study."""
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.problem, parent(run)), []).append(run)
    return [make_study(*key, groups[key]) for key in sorted(groups)]


def make_study(problem: str, place: str, runs: Sequence[Run]) -> Study:
    """Return the study of one problem in one place; its solvers in order of name, seeds in order."""
    solvers: dict[str, list[Run]] = {}
    for run in sorted(runs, key=lambda run: (run.solver, run.seed, run.place)):
        solvers.setdefault(run.solver, []).append(run)
    return Study(problem, place, tuple(Entry(solver, tuple(own)) for solver, own in solvers.items()))


def sample(study: Study, most: int) -> Study:
    """Keep at most ``most`` runs of each solver, evenly among its seeds, the first and the last of them."""

    def some(runs: tuple[Run, ...]) -> tuple[Run, ...]:
        chosen = np.linspace(0, len(runs) - 1, min(len(runs), most)).round().astype(int)
        return tuple(runs[place] for place in chosen)

    return Study(study.problem, study.place, tuple(Entry(each.solver, some(each.runs)) for each in study.entries))


def parent(run: Run) -> str:
    """Return the folder that holds the run folder, below the report's folder."""
    return run.place.rpartition("/")[0]
