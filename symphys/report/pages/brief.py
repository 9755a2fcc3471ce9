"""Many run folders, read for tables: their results without variables, examinations and iterations.

``read_run`` takes a hundred times as long, which thousands of runs cannot afford. What both read is the same; what is
left out is empty.
"""

from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from symphys import json_values as values
from symphys.files import emptied
from symphys.results.config import Config
from symphys.results.file_names import CONFIG, RESULT, TRACE
from symphys.results.result import BackendRecord, CheckRecord, StageRecord, everything_met
from symphys.results.run import Run, is_result, read_or_note
from symphys.results.text_files import ReportError, read_table
from symphys.results.trace import read_trace

LARGE = ("z", "trust")
"""Where the keys of result.json begin that take most of it, and that no table shows; and where their objects end."""
CHECK = ("kind", "name", "error", "tolerance", "ratio", "met", "unit")
MOST_KEPT = 1000
MOST_AT_ONCE = 2**20
READ = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


class BriefReader:
    """Reads run folders below a root; what thousands of them have in common is read once."""

    def __init__(self, root: Path) -> None:
        """Nothing is read yet."""
        self.root, self.prefix = root, f"{root}/"
        self.kept: dict[str, Any] = {}

    def __call__(self, folder: Path) -> Run:
        """The result and the settings of a run folder; what cannot be read is listed in ``faults``."""
        faults: list[str] = []
        try:
            result = read_brief_table(f"{folder}/{RESULT}")
        except ReportError as error:
            result = {}
            faults.append(str(error))
        readable = is_result(result, faults)
        config = read_config_table(f"{folder}/{CONFIG}", faults)
        named = result if readable else config
        problem = values.name(named.get("problem")) or folder.resolve().parent.name
        about: dict[str, Any] = {
            "problem": problem,
            "title": values.name(result.get("title") if readable else None) or problem,
            "solver": values.name(named.get("solver")) or folder.resolve().name,
            "seed": values.whole(named.get("seed")),
            "folder": folder,
            "place": self.place_of(folder),
            "settings": self.once("settings", config.get("settings"), read_settings),
            "faults": tuple(faults),
        }
        if not readable:
            return Run(**about, solved=False, status="unreadable", advice="")
        if "verdict" not in result:
            return self.older(result, about)
        found = self.numbers(result)
        return Run(**about, **found, readable=True, met=all(check.met for check in found["checks"]))

    def place_of(self, folder: Path) -> str:
        """The folder's path below the root, with forward slashes."""
        text = str(folder)
        if os.sep == "/" and text.startswith(self.prefix):
            return text[len(self.prefix) :]
        return folder.relative_to(self.root).as_posix()

    def numbers(self, result: Mapping[str, object]) -> dict[str, Any]:
        """The fields of a result that tables show."""
        stages: Any = result.get("stages")
        stages = stages if isinstance(stages, list) else []
        smooth = any(values.number(stage.get("smoothing")) > 0 for stage in stages if isinstance(stage, dict))
        checks: Any = result.get("checks")
        checks = checks if isinstance(checks, list) else []
        return {
            "solved": result.get("solved") is True,
            "status": values.name(result.get("status")),
            "verdict": values.name(result.get("verdict")),
            "advice": "",
            "objective": values.number(result.get("objective")),
            "equivalents": values.number(result.get("equivalents")),
            "outputs": values.measures(result.get("outputs")),
            "counts": values.measures(result.get("counts")),
            "seconds": values.measures(result.get("seconds")),
            "checks": tuple(read_check(each) for each in checks if isinstance(each, dict))
            if isinstance(checks, list)
            else (),
            "stages": tuple(values.record(StageRecord, stage) for stage in stages) if smooth else (),
            "guess": values.measures(result.get("guess")) if smooth else {},
            "doubts": values.names(result.get("doubts")),
            "when": values.name(result.get("when")),
            "command": values.name(result.get("command")),
            "versions": self.once("versions", result.get("versions"), read_versions),
            "backend": self.once("backend", result.get("backend"), lambda value: values.record(BackendRecord, value)),
        }

    def older(self, result: Mapping[str, object], about: Mapping[str, Any]) -> Run:
        """A result from before verdicts, which follow from its examination."""
        run = Run.from_json(result, **about, readable=True, z={}, met=False)
        return Run(**{**vars(run), "met": everything_met(result, run), "trust": {}})

    def once(self, kind: str, value: object, read: Any) -> Any:
        """What ``read`` makes of a value, the same object for equal values."""
        key = f"{kind} {value!r}"
        if key not in self.kept:
            if len(self.kept) >= MOST_KEPT:
                self.kept.clear()
            self.kept[key] = read(value)
        return self.kept[key]


def read_check(entry: dict[str, Any]) -> CheckRecord:
    """A check; one that lacks something as ``CheckRecord.from_json`` reads it."""
    kind, name, error, tolerance, ratio, met, unit = map(entry.get, CHECK)
    if type(error) is type(tolerance) is type(ratio) is float and kind and name:
        kind, name, unit = values.name(kind), values.name(name), values.name(unit)
        return CheckRecord(kind, name, error, tolerance, ratio, met is True, unit)
    return CheckRecord.from_json(entry)


def read_settings(value: object) -> Mapping[str, Any]:
    """Settings by their keys."""
    return Config.from_json({"settings": value}).settings


def read_config_table(path: str, faults: list[str]) -> dict[str, Any]:
    """The object of config.json; empty, with a sentence in ``faults``, if there is none."""
    try:
        content = json.loads(read_regular(path))
    except (OSError, ValueError, RecursionError):
        content = None
    return content if isinstance(content, dict) else read_or_note(Path(path), faults)


def read_versions(value: object) -> dict[str, str]:
    """Versions by what they are of."""
    return {name: values.name(version) for name, version in values.table(value).items()}


def read_brief_table(path: str) -> dict[str, object]:
    """The object of result.json without what is ``LARGE``; all of it where the text is not as this program writes it.

    Raises ReportError, see ``read_table``.
    """
    try:
        content = json.loads(emptied(read_regular(path), LARGE))
    except (OSError, ValueError, RecursionError):
        return read_table(Path(path))
    if not isinstance(content, dict) or "verdict" not in content:  # older: the verdict follows from the examination
        return read_table(Path(path))
    return content


def read_regular(path: str) -> bytes:
    """What a regular file holds; OSError for anything else, which is not waited for.

    Paths and files of the standard library's own classes take as long as all the rest of reading a run.
    """
    number = os.open(path, READ)
    try:
        about = os.fstat(number)
        if not stat.S_ISREG(about.st_mode):
            raise OSError(errno.EINVAL, "a regular file is needed", path)
        parts = [os.read(number, about.st_size + 1)]
        while parts[-1]:
            parts.append(os.read(number, MOST_AT_ONCE))
        return b"".join(parts)
    finally:
        os.close(number)


def with_trace(run: Run) -> Run:
    """The same with its iterations."""
    return replace(run, trace=read_trace(run.folder / TRACE, []))
