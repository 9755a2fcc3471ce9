"""A run's folder: where its files are, whether the run is done, and its lock."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from symphys import files
from symphys.results.case_name import case_name
from symphys.results.config import Config, read_config
from symphys.results.file_names import CHECKPOINT, CONFIG, GUESS, LOG, PROBLEM, RESULT, SCENE, TRACE, TRAJECTORY
from symphys.results.result import Result, read_result
from symphys.results.trace import trace_text

try:
    import fcntl
except ImportError:  # not a POSIX system: concurrent commands are then kept apart by atomic writes alone
    fcntl = None  # type: ignore[assignment]


class FolderBusy(files.FileError):
    """Another command is working in the folder."""


@dataclasses.dataclass(frozen=True)
class RunFolder:
    """The files of one run; ``symphys.results.file_names`` lists what each holds."""

    path: Path

    @classmethod
    def of(
        cls, out: Path, problem: str, solver: str, seed: int, settings: Mapping[str, object] | None = None
    ) -> RunFolder:
        """OUT/<case>/<solver>-seed<k>; FileError for a problem whose name would lead out of OUT."""
        if problem in {"", ".", ".."}:
            raise files.FileError(f"a problem called {problem!r} can have no folder: rename its file")
        return cls(out / case_name(problem, settings or {}) / f"{solver}-seed{seed}")

    def earlier(self, config: Config) -> Result | None:
        """The result of the very run that ``config`` asks for, interrupted or finished; None if there is none."""
        try:
            same = read_config(self.path / CONFIG).key == config.key
            return read_result(self.path / RESULT) if same else None
        except files.FileError:
            return None

    def checkpoint(self) -> dict[str, object] | None:
        """Where an interrupted run stopped; None if that is not known."""
        try:
            value = files.numbers(files.read_json(self.path / CHECKPOINT))
        except files.FileError:
            return None
        return value if isinstance(value, dict) else None

    def begin(self, config: Config, problem_text: str) -> None:
        """Take away what an earlier run of another configuration left, then write down what is asked for."""
        files.make_folder(self.path)
        for name in (RESULT, CHECKPOINT, CONFIG, TRAJECTORY, GUESS, SCENE, TRACE, LOG):
            files.remove(self.path / name)
        files.write_text(self.path / PROBLEM, problem_text)
        files.write_json(self.path / CONFIG, config.to_json())

    def write_trace(self, rows: Iterable[Mapping[str, object]]) -> None:
        """Write one line per iteration under a header with the names of the columns; what a row lacks is nan."""
        files.write_text(self.path / TRACE, trace_text(rows))

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other commands out; FolderBusy if one is in. The lock ends with its process, however that ends."""
        files.make_folder(self.path)
        if fcntl is None:
            yield
            return
        handle = os.open(self.path, os.O_RDONLY)
        try:
            take(handle, self.path)
            yield
        finally:
            os.close(handle)


def take(handle: int, path: Path) -> None:
    """Lock an open folder; file systems without locks are let pass."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise FolderBusy(f"another symphys command is working in {path}; nothing was changed there") from error
    except OSError:
        return
