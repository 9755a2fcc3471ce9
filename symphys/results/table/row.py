"""The row of one run, from result.json and config.json without their large fields.

The variables and the numbers of the examination are most of a result.json and no row has them. They are cut out of the
text before it is parsed, where it is laid out as this program lays it out.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from symphys import json_values as values
from symphys.files import strict
from symphys.findings.verdict import NOT_SOLVED
from symphys.results.config import case_name
from symphys.results.file_names import CONFIG, RESULT
from symphys.results.result import CheckRecord, Result
from symphys.results.run import is_result, read_or_note
from symphys.results.table.columns import COST, MAX_EXACT_INTEGER, OUTPUT, UNFINISHED, UNREADABLE, Row, setting_column
from symphys.results.text_files import ReportError, read_light_table

WAITING = "no result yet: the run is in progress or was stopped"


def read_row(folder: Path) -> Row:
    """Read the row of a run folder, without its "run" and without what is not known.

    Never fails: "fault" says what could not be read. A run without result.json is "unfinished"; one whose result.json
    cannot be read is "unreadable".
    """
    return {column: value for column, value in whole_row(folder).items() if value is not None and value != ""}


def row_of(folder: Path, config: dict[str, Any], result: dict[str, Any]) -> Row:
    """Return the row of a run whose config.json and result.json hold this, as ``read_row`` does."""
    row = make_row(folder, config, result, [])
    return {column: value for column, value in row.items() if value is not None and value != ""}


def whole_row(folder: Path) -> Row:
    """Return the row with None and empty texts for what is not known."""
    faults: list[str] = []
    config = read_or_note(folder / CONFIG, faults, read_light_table)
    try:
        result = read_light_table(folder / RESULT)
    except ReportError as error:
        if not (folder / RESULT).exists():
            return without_result(folder, config, UNFINISHED, WAITING, faults)
        return without_result(folder, config, UNREADABLE, str(error), [str(error), *faults])
    wrong: list[str] = []
    if not is_result(result, wrong):
        return without_result(folder, config, UNREADABLE, wrong[0], [*wrong, *faults])
    try:
        return make_row(folder, config, result, faults)
    except (OSError, ValueError, RecursionError) as error:
        why = f"{RESULT}: cannot be judged ({values.name(str(error))})"
        return without_result(folder, config, UNREADABLE, why, [why, *faults])


def make_row(folder: Path, config: Mapping[str, Any], result: Mapping[str, Any], faults: Sequence[str] = ()) -> Row:
    """Return the row of a run by the objects of its files."""
    judged = result if result.get("verdict") else whole_result(folder)
    seconds, provenance, backend = (table(result.get(key)) for key in ("seconds", "provenance", "backend"))
    return {
        **asked(folder, config, result),
        "verdict": values.name(judged.get("verdict")) or NOT_SOLVED,
        "status": values.name(result.get("status")),
        "solved": judged.get("solved") is True,
        "objective": number(result.get("objective")),
        "worst": worst(result.get("checks")),
        **named(OUTPUT, result.get("outputs")),
        **named(COST, result.get("costs")),
        "iterations": number(result.get("iterations")),
        "equivalents": number(result.get("equivalents")),
        "solve_seconds": number(seconds.get("solve")),
        "compile_seconds": number(seconds.get("compile")),
        "build_seconds": number(seconds.get("build")),
        "peak_memory": number(provenance.get("peak_memory")),
        "backend": values.name(backend.get("name")),
        "host": values.name(provenance.get("host")),
        "when": values.name(result.get("when")),
        "why": why_not(judged, result),
        "fault": "; ".join(faults),
    }


def without_result(folder: Path, config: Mapping[str, Any], word: str, why: str, faults: Sequence[str]) -> Row:
    """Return the row of a folder in which no result can be read."""
    known = asked(folder, config, {})
    return {**known, "verdict": word, "status": word, "solved": False, "why": why, "fault": "; ".join(faults)}


def asked(folder: Path, config: Mapping[str, Any], result: Mapping[str, Any]) -> Row:
    """Return problem, case, solver, seed and settings; unknown problem and solver follow from the folders' names."""
    both = {**config, **result}
    problem = values.name(both.get("problem")) or folder.absolute().parent.name
    settings = table(config.get("settings"))
    return {
        "problem": problem,
        "case": case_name(problem, settings),
        "solver": values.name(both.get("solver")) or folder.absolute().name,
        "seed": number(both.get("seed")),
        **{setting_column(values.name(key)): plain(settings[key]) for key in sorted(settings)},
    }


def named(prefix: str, numbers: object) -> Row:
    """Return numbers by the names of their columns."""
    return {prefix + values.name(key): number(value) for key, value in table(numbers).items()}


def table(value: object) -> Mapping[str, Any]:
    """Return a JSON object; empty for anything else."""
    return value if isinstance(value, dict) else {}


def number(value: object) -> float | int | None:
    """Return a number, as an integer if it is one; None where unknown."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) < MAX_EXACT_INTEGER:
        return value
    read = values.number(value)
    return None if math.isnan(read) else read


def plain(value: object) -> bool | float | int | str | None:
    """Return a setting unchanged; a list or table as JSON text."""
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, int | float):
        return number(value)
    return values.name(value) if isinstance(value, str) else values.name(json.dumps(strict(value)))


def worst(checks: object) -> float | int | None:
    """Return the largest error / tolerance, inf where one is unknown; None without checks."""
    asked = [check for check in checks if isinstance(check, dict)] if isinstance(checks, list) else []
    if not asked:
        return None
    ratios = [check["ratio"] if "ratio" in check else CheckRecord.from_json(check).ratio for check in asked]
    found = [number(ratio) for ratio in ratios]
    return max(math.inf if ratio is None else ratio for ratio in found)


def why_not(judged: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    """Say why a run is not to be trusted, or what its solver says; empty for one that is solved."""
    doubts = values.names(judged.get("doubts"))
    if doubts:
        return values.name("; ".join(doubts))
    return "" if judged.get("solved") is True else values.name(result.get("advice"))


def whole_result(folder: Path) -> dict[str, Any]:
    """Judge a file that is older than verdicts anew, which needs all of it; return verdict, solved and doubts."""
    found = Result.from_json(json.loads((folder / RESULT).read_bytes()))
    return {"verdict": found.verdict, "solved": found.solved, "doubts": list(found.doubts)}
