"""A run folder read into a Run: reading never fails; what is missing is listed in ``faults``."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from symphys import json_values as values
from symphys.findings.examination import Examination
from symphys.findings.levels import Judged
from symphys.records import dataclass
from symphys.results.config import Config
from symphys.results.file_names import CONFIG, PROBLEM, RESULT, TRACE
from symphys.results.result import (
    FORMAT,
    BackendRecord,
    CheckRecord,
    Result,
    StageRecord,
    VariableRecord,
    everything_met,
)
from symphys.results.text_files import ReportError, read_light_table, read_table, read_words
from symphys.results.trace import Trace, read_trace


@dataclass(frozen=True, eq=False)
class Run(Result):
    """A run folder: its result, and the rest of its files.

    Attributes:
        folder: where it is.
        place: the folder's path below the report's folder, with forward slashes.
        readable: whether there is a result; if not, only names and ``faults`` mean anything.
        description: of the problem.
        settings: changes by the command line in the problem's file, by dotted key.
        met: whether nothing is missed.
        examination: how far the solution can be trusted.
        trace: the iterations.
        faults: unreadable parts, one sentence each.
    """

    folder: Path = Path()
    place: str = ""
    readable: bool = False
    description: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    met: bool = False
    examination: Examination = field(default_factory=Examination)
    trace: Trace = field(default_factory=lambda: Trace({}, 0))
    faults: tuple[str, ...] = ()

    @property
    def variables(self) -> tuple[VariableRecord, ...]:
        """Return the variables in the file's order."""
        return tuple(self.z.values())

    @property
    def judged(self) -> Judged:
        """Return the judgement of the exact rollout."""
        return replace(self.judge(self.met), accepted=self.accepted)


def read_run(folder: Path, root: Path) -> Run:
    """Read ``folder``; places are given relative to ``root``."""
    faults: list[str] = []
    result = read_or_note(folder / RESULT, faults)
    readable = is_result(result, faults)
    config = read_or_note(folder / CONFIG, faults)
    asked = Config.from_json({**config, **result} if readable else config)
    result = result if readable else {}
    trace = read_trace(folder / TRACE, faults)
    problem = asked.problem or folder.resolve().parent.name
    written = read_problem(folder / PROBLEM)
    given: dict[str, Any] = {
        "problem": problem,
        "title": values.name(result.get("title")) or problem,
        "solver": asked.solver or folder.resolve().name,
        "seed": asked.seed,
        "folder": folder,
        "place": folder.relative_to(root).as_posix(),
        "readable": readable,
        "description": values.words(written.get("description")),
        "settings": asked.settings,
        "examination": Examination.from_json(result.get("trust")),
        "trace": trace,
        "met": False,
        "faults": tuple(faults),
    }
    run = Run.from_json(result, **given)
    return replace(
        run,
        status=run.status if readable else "unreadable",
        met=everything_met(result, run),
        z={name: replace(v, sets=written_sets(written, name) or v.sets) for name, v in run.z.items()},
    )


def is_result(result: Mapping[str, object], faults: list[str]) -> bool:
    """Whether a table is a result; ``faults`` says so where it is none, or of another format."""
    readable = "solver" in result and "problem" in result
    if not readable and not faults:
        faults.append(f"{RESULT}: not a result of symphys (it names no problem and solver)")
    elif readable and result.get("format") != FORMAT:
        faults.append(f"{RESULT}: format {values.name(result.get('format')) or 'unknown'}, this report reads {FORMAT}")
    return readable


def read_or_note(path: Path, faults: list[str], read: Callable[[Path], dict[str, Any]] = read_table) -> dict[str, Any]:
    """Read the table in a file; empty, with a sentence in ``faults``, if there is none."""
    try:
        return read(path)
    except ReportError as error:
        faults.append(str(error))
        return {}


def read_problem(path: Path) -> dict[str, object]:
    """Read the tables of a problem file; empty if it cannot be read: it is shown as text elsewhere."""
    try:
        return tomllib.loads(read_words(path))
    except (ReportError, tomllib.TOMLDecodeError, RecursionError):
        return {}


def written_sets(problem: dict[str, object], variable: str) -> tuple[str, ...]:
    """Return what a variable sets, with indices, as the problem file says; empty if it does not."""
    for entry in values.tables(problem.get("variable")):
        if entry.get("name") == variable:
            sets = entry.get("sets")
            return values.names(sets if isinstance(sets, list) else [sets])
    return ()


CHECK = ("kind", "name", "error", "tolerance", "ratio", "met", "unit")
MAX_INTERNED = 1000
"""Largest number of values that are kept to be shared by equal ones."""


class BriefReader:
    """Reads run folders below a root for tables: results without variables, examinations and iterations.

    ``read_run`` takes a hundred times as long, which thousands of runs cannot afford. What both read is the same; what
    is left out is empty. What many folders have in common is read once.
    """

    def __init__(self, root: Path) -> None:
        """Set the folder to which places are relative."""
        self.root, self.prefix = root, f"{root}/"
        self.kept: dict[str, Any] = {}

    def __call__(self, folder: Path) -> Run:
        """Read the result and the settings of a run folder; what cannot be read is listed in ``faults``."""
        faults: list[str] = []
        try:
            result = read_brief_table(f"{folder}/{RESULT}")
        except ReportError as error:
            result = {}
            faults.append(str(error))
        readable = is_result(result, faults)
        config = read_or_note(Path(f"{folder}/{CONFIG}"), faults, read_light_table)
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
        """Return the folder's path below the root, with forward slashes."""
        text = str(folder)
        if os.sep == "/" and text.startswith(self.prefix):
            return text[len(self.prefix) :]
        return folder.relative_to(self.root).as_posix()

    def numbers(self, result: Mapping[str, object]) -> dict[str, Any]:
        """Return the fields of a result that tables show."""
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
            "checks": tuple(read_check(each) for each in checks if isinstance(each, dict)),
            "stages": tuple(values.record(StageRecord, stage) for stage in stages) if smooth else (),
            "guess": values.measures(result.get("guess")) if smooth else {},
            "doubts": values.names(result.get("doubts")),
            "when": values.name(result.get("when")),
            "command": values.name(result.get("command")),
            "versions": self.once("versions", result.get("versions"), read_versions),
            "backend": self.once("backend", result.get("backend"), lambda value: values.record(BackendRecord, value)),
        }

    def older(self, result: Mapping[str, object], about: Mapping[str, Any]) -> Run:
        """Read a result that is older than verdicts, which follow from its examination."""
        run = Run.from_json(result, **about, readable=True, z={}, met=False)
        return Run(**{**vars(run), "met": everything_met(result, run), "trust": {}})

    def once(self, kind: str, value: object, read: Any) -> Any:
        """Return ``read(value)``, the same object for equal values."""
        key = f"{kind} {value!r}"
        if key not in self.kept:
            if len(self.kept) >= MAX_INTERNED:
                self.kept.clear()
            self.kept[key] = read(value)
        return self.kept[key]


def read_check(entry: dict[str, Any]) -> CheckRecord:
    """Read a check quickly; one that lacks something is left to ``CheckRecord.from_json``."""
    kind, name, error, tolerance, ratio, met, unit = map(entry.get, CHECK)
    if type(error) is type(tolerance) is type(ratio) is float and kind and name:
        kind, name, unit = values.name(kind), values.name(name), values.name(unit)
        return CheckRecord(kind, name, error, tolerance, ratio, met is True, unit)
    return CheckRecord.from_json(entry)


def read_settings(value: object) -> Mapping[str, Any]:
    """Read settings by their keys."""
    return Config.from_json({"settings": value}).settings


def read_versions(value: object) -> dict[str, str]:
    """Read versions by the names of packages."""
    return {name: values.name(version) for name, version in values.table(value).items()}


def read_brief_table(path: str) -> dict[str, Any]:
    """Read the object of result.json without what is ``HEAVY``; all of it where it is older than verdicts.

    A verdict that the file lacks follows from its examination. Raises ReportError.
    """
    content = read_light_table(path)
    return content if "verdict" in content else read_table(Path(path))


def with_trace(run: Run) -> Run:
    """Return the run with its iterations."""
    return replace(run, trace=read_trace(run.folder / TRACE, []))
