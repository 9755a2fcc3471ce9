"""A run folder read into a Run: reading never fails; what is missing is listed in ``faults``."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from symphys import json_values as values
from symphys.findings.examination import Examination
from symphys.findings.levels import Judged
from symphys.results.config import Config
from symphys.results.file_names import CONFIG, PROBLEM, RESULT, TRACE
from symphys.results.result import FORMAT, Result, VariableRecord, everything_met
from symphys.results.text_files import ReportError, read_table, read_words
from symphys.results.trace import Trace, read_trace


@dataclass(frozen=True, eq=False)
class Run(Result):
    """One run folder: its result, and the rest of its files.

    Attributes:
        folder: where it is.
        place: the folder's path below the report's folder, with forward slashes.
        readable: whether there is a result; if not, only names and ``faults`` mean anything.
        description: of the problem.
        settings: what the command line changed in the problem's file, by dotted key.
        met: whether nothing is missed.
        examination: how far the solution can be trusted.
        trace: the iterations.
        faults: what could not be read, one sentence each.
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
        """The variables in the file's order."""
        return tuple(self.z.values())

    @property
    def judged(self) -> Judged:
        """How it was judged."""
        return self.judge(self.met)


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


def read_or_note(path: Path, faults: list[str]) -> dict[str, object]:
    """The table in a file; empty, with a sentence in ``faults``, if there is none."""
    try:
        return read_table(path)
    except ReportError as error:
        faults.append(str(error))
        return {}


def read_problem(path: Path) -> dict[str, object]:
    """The tables of a problem file; empty if it cannot be read: it is shown as text elsewhere."""
    try:
        return tomllib.loads(read_words(path))
    except (ReportError, tomllib.TOMLDecodeError, RecursionError):
        return {}


def written_sets(problem: dict[str, object], variable: str) -> tuple[str, ...]:
    """What a variable sets, with indices, as the problem file says; empty if it does not."""
    for entry in values.tables(problem.get("variable")):
        if entry.get("name") == variable:
            sets = entry.get("sets")
            return values.names(sets if isinstance(sets, list) else [sets])
    return ()
