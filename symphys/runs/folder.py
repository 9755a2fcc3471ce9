"""The folder of a run: its files, and how a run begins there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from symphys import files
from symphys.records import dataclass
from symphys.results.config import Config, case_name
from symphys.results.file_names import (
    CHECKPOINT,
    CONFIG,
    GAINS,
    GUESS,
    LOG,
    MULTIPLIERS,
    PROBLEM,
    RESULT,
    SCENE,
    TRACE,
    TRAJECTORY,
)
from symphys.results.trace import trace_text

WRITTEN = (RESULT, CHECKPOINT, CONFIG, TRAJECTORY, GUESS, GAINS, MULTIPLIERS, SCENE, TRACE, LOG)
"""Files of a run besides the problem; the result is removed first, since nothing counts without it."""


@dataclass(frozen=True)
class RunFolder:
    """The files of one run; ``symphys.results.file_names`` lists what each holds."""

    path: Path

    @classmethod
    def of(
        cls,
        out: Path,
        problem: str,
        solver: str,
        seed: int,
        settings: Mapping[str, object] | None = None,
        guess: str = "",
    ) -> RunFolder:
        """Return OUT/<case>/<solver>-seed<k>; FileError for a problem whose name would lead out of OUT."""
        if problem in {"", ".", ".."}:
            raise files.FileError(f"a problem called {problem!r} can have no folder: rename its file")
        return cls(out / case_name(problem, settings or {}, guess) / f"{solver}-seed{seed}")

    def checkpoint(self) -> dict[str, object] | None:
        """Return the checkpoint of an interrupted run; None if there is none that can be read."""
        try:
            value = files.numbers(files.read_json(self.path / CHECKPOINT))
        except files.FileError:
            return None
        return value if isinstance(value, dict) else None

    def begin(self, config: Config, problem_text: str) -> None:
        """Remove the files of an earlier configuration, then write problem.toml and config.json."""
        files.make_folder(self.path)
        for name in WRITTEN:
            files.remove(self.path / name)
        files.write_text(self.path / PROBLEM, problem_text, at_once=False)
        files.write_json(self.path / CONFIG, config.to_json(), at_once=False)

    def clear(self) -> None:
        """Remove temporary files of killed processes; the caller must hold the claim of the folder."""
        begun = tuple(f".{name}." for name in (PROBLEM, *WRITTEN))
        for path in self.path.iterdir():
            if path.name.startswith(begun):
                files.remove(path)

    def write_trace(self, rows: Iterable[Mapping[str, object]], at_once: bool = True) -> None:
        """Write one line per iteration under a header with the names of the columns; what a row lacks is nan."""
        files.write_text(self.path / TRACE, trace_text(rows), at_once)
