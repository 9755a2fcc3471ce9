"""A run folder read into a Run: never fails, but says what was missing."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

from symphys.findings import values
from symphys.findings.reading import make_trust
from symphys.findings.verdict import rule
from symphys.results import text_files as tables
from symphys.results.records import (
    Array,
    Check,
    Effort,
    Origin,
    ReportError,
    Run,
    Trace,
    Variable,
)
from symphys.results.stage_record import Stage

RESULT = "result.json"
CONFIG = "config.json"
PROBLEM = "problem.toml"
TRACE = "trace.csv"
FORMAT = 1


def read_run(folder: Path, root: Path) -> Run:
    """Read ``folder``; places are told relative to ``root``."""
    faults: list[str] = []
    result = read_or_note(folder / RESULT, faults)
    readable = "solver" in result and "problem" in result
    if not readable and not faults:
        faults.append(f"{RESULT}: not a result of symphys (it names no problem and solver)")
    elif readable and result.get("format") != FORMAT:
        faults.append(f"{RESULT}: format {values.name(result.get('format')) or 'unknown'}, this report reads {FORMAT}")
    config = read_or_note(folder / CONFIG, faults)
    problem = read_problem(folder / PROBLEM)
    trace = read_trace(folder / TRACE, faults)
    named = {**config, **result} if readable else config
    run = make_run(folder, folder.relative_to(root).as_posix(), named, result if readable else {}, trace)
    return replace(
        run,
        readable=readable,
        status=run.status if readable else "unreadable",
        faults=tuple(faults),
        description=values.words(problem.get("description")),
        variables=tuple(replace(v, sets=written_sets(problem, v.name) or v.sets) for v in run.variables),
    )


def make_run(folder: Path, place: str, named: dict[str, object], result: dict[str, object], trace: Trace) -> Run:
    """Turn the tables of a run folder into a record; ``named`` tells problem, solver and seed."""
    problem = values.name(named.get("problem")) or folder.resolve().parent.name
    checks = tuple(make_check(entry) for entry in values.tables(result.get("checks")))
    run = Run(
        folder=folder,
        place=place,
        readable=True,
        problem=problem,
        title=values.name(result.get("title")) or problem,
        description="",
        solver=values.name(named.get("solver")) or folder.resolve().name,
        seed=values.whole(named.get("seed")),
        solved=result.get("solved") is True,
        met=all(check.met for check in checks) and ("verdict" in result or result.get("solved") is True),
        verdict=values.name(result.get("verdict")),
        doubts=values.names(result.get("doubts")),
        status=values.name(result.get("status")),
        advice=values.name(result.get("advice")),
        objective=values.number(result.get("objective")),
        costs=values.measures(result.get("costs")),
        outputs=values.measures(result.get("outputs")),
        checks=checks,
        variables=tuple(make_variable(key, entry) for key, entry in values.table(result.get("z")).items()),
        effort=make_effort(result),
        trust=make_trust(values.table(result.get("trust"))),
        origin=make_origin(result),
        trace=trace,
        guess=values.measures(result.get("guess")),
        stages=tuple(make_stage(entry) for entry in values.tables(result.get("stages"))),
        faults=(),
    )
    return run if run.verdict else judged_late(run, values.table(result.get("trust")))


def judged_late(run: Run, trust: dict[str, object]) -> Run:
    """A run whose file is older than verdicts, ruled on as a new one would be."""
    ruling = rule(run.status, run.judged, trust)
    return replace(run, solved=ruling.solved, verdict=ruling.verdict, doubts=ruling.doubts)


def make_effort(result: dict[str, object]) -> Effort:
    """What the solve took."""
    return Effort(
        iterations=values.number(result.get("iterations")),
        counts=values.measures(result.get("counts")),
        price=values.measures(result.get("price")),
        equivalents=values.number(result.get("equivalents")),
        seconds=values.measures(result.get("seconds")),
    )


def make_stage(entry: dict[str, object]) -> Stage:
    """One of ``stages``."""
    read = ("smoothing", "objective", "worst", "exact_objective", "exact_worst", "equivalents", "seconds")
    return Stage(
        status=values.name(entry.get("status")),
        solved=entry.get("solved") is True,
        counts=values.measures(entry.get("counts")),
        **{key: values.number(entry.get(key)) for key in read},
    )


def make_origin(result: dict[str, object]) -> Origin:
    """Where the result comes from."""
    versions = {key: values.name(entry) for key, entry in values.table(result.get("versions")).items()}
    when, command = (values.name(result.get(key)) for key in ("when", "command"))
    return Origin(versions, when, command, backend_words(result.get("backend")))


def backend_words(value: object) -> str:
    """What evaluated, in a line."""
    told = values.table(value)
    lanes, threads = (values.whole(told.get(key)) for key in ("lanes", "threads"))
    name, precision, compiler, compiled, note = (
        values.name(told.get(key)) for key in ("name", "precision", "compiler", "compiled", "note")
    )
    counts = [f"{n} {what}{'s' * (n > 1)}" for n, what in ((lanes, "lane"), (threads, "thread")) if n]
    start = {"cold": "compiled anew", "warm": "taken from the cache"}.get(compiled, "")
    parts = [name, *counts, precision and f"{precision} precision", compiler, start]
    return "; ".join(filter(None, [", ".join(filter(None, parts)), note]))


def read_or_note(path: Path, faults: list[str]) -> dict[str, object]:
    """The table in a file; empty, with a sentence in ``faults``, if there is none."""
    try:
        return tables.read_table(path)
    except ReportError as error:
        faults.append(str(error))
        return {}


def read_problem(path: Path) -> dict[str, object]:
    """The tables of a problem file; empty if it cannot be read: it is shown as text elsewhere."""
    try:
        return tomllib.loads(tables.read_words(path))
    except (ReportError, tomllib.TOMLDecodeError, RecursionError):
        return {}


def written_sets(problem: dict[str, object], variable: str) -> tuple[str, ...]:
    """What a variable sets, with indices, as the problem file says; empty if it does not."""
    for entry in values.tables(problem.get("variable")):
        if entry.get("name") == variable:
            sets = entry.get("sets")
            return values.names(sets if isinstance(sets, list) else [sets])
    return ()


def make_check(entry: dict[str, object]) -> Check:
    """One of ``checks``."""
    error, tolerance = values.number(entry.get("error")), values.number(entry.get("tolerance"))
    kind = values.name(entry.get("kind")) or "check"
    ratio = values.number(entry["ratio"]) if "ratio" in entry else share(error, tolerance)
    return Check(kind, values.name(entry.get("name")) or kind, error, tolerance, ratio, entry.get("met") is True)


def share(error: float, tolerance: float) -> float:
    """Error / tolerance; inf for an error without any tolerance."""
    if tolerance > 0:
        return error / tolerance
    return 0.0 if error == 0 else error * np.inf


def make_variable(key: str, entry: object) -> Variable:
    """One of ``z``; a shape that does not fit the values is replaced by one knot."""
    content = values.table(entry)
    value = values.numbers(content.get("value"))
    shape = [values.whole(size) for size in values.numbers(content.get("shape"))[:2]]
    fits = len(shape) == 2 and min(shape) > 0 and shape[0] * shape[1] == value.size
    components, knots = (shape[0], shape[1]) if fits else (value.size, 1)

    def block(field: str, missing: float) -> Array:
        flat = values.numbers(content.get(field))
        flat = flat if flat.size == value.size else np.full(value.size, np.nan)
        return np.where(np.isnan(flat), missing, flat).reshape((knots, components)).T

    return Variable(
        name=key,
        sets=values.names(content.get("sets")),
        value=block("value", np.nan),
        guess=block("guess", np.nan),
        lower=block("lower", -np.inf),
        upper=block("upper", np.inf),
    )


def read_trace(path: Path, faults: list[str]) -> Trace:
    """The columns of trace.csv; rows that are cut short are left out."""
    try:
        with path.open(encoding="utf-8", errors="replace", newline="") as file:
            rows = list(csv.reader(file))
    except OSError as error:
        faults.append(f"{path.name}: {tables.reason(error)}")
        return Trace({}, 0)
    except csv.Error as error:
        faults.append(f"{path.name}: {values.name(str(error))}")
        return Trace({}, 0)
    header = [values.name(title) for title in rows[0]] if rows else []
    whole = [row for row in rows[1:] if len(row) == len(header)]
    if len(whole) < len(rows) - 1:
        faults.append(f"{path.name}: {len(rows) - 1 - len(whole)} row(s) cut short, left out")
    columns = {title: np.array([values.number(row[i]) for row in whole], float) for i, title in enumerate(header)}
    return Trace(columns, len(whole))
