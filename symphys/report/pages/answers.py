"""What runs found, as numbers with units, and where solvers found different answers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from symphys.findings import writing
from symphys.findings.writing import show, titled, with_unit
from symphys.report.charts import palette
from symphys.report.charts.run import component_labels
from symphys.report.pages.markup import Html, card, dot, join, table, tag
from symphys.results.discovery import Entry, Study
from symphys.results.file_names import RESULT
from symphys.results.result import VariableRecord
from symphys.results.run import Run
from symphys.results.text_files import ReportError, read_table
from symphys.types import Array

MOST_COMPONENTS = 6
"""Components of a variable that are shown one by one; of more the range is."""
MOST_ROWS, MOST_NAMED = 24, 4
ANOTHER = 0.1
"""Answers differ where a number does by more than this share of the largest of its variable."""


def variables_of(run: Run) -> list[VariableRecord]:
    """Read the variables of a run, also of one that was read for tables; none where they cannot be read."""
    if run.z:
        return list(run.variables)
    try:
        entries = read_table(run.folder / RESULT).get("z")
    except ReportError:
        return []
    pairs = entries.items() if isinstance(entries, Mapping) else ()
    return [replace(VariableRecord.from_json(entry), name=name) for name, entry in pairs]


def is_listed(variable: VariableRecord) -> bool:
    """Whether its components are shown one by one."""
    return variable.value.shape[1] == 1 and len(variable.value) <= MOST_COMPONENTS


def found_numbers(run: Run) -> dict[str, float]:
    """Return what a run found, by names with units: components of variables that are no inputs over time."""
    found = {}
    for variable in filter(is_listed, variables_of(run)):
        for label, value in zip(component_labels(variable), variable.value[:, 0].tolist(), strict=True):
            found[titled(label, variable.unit)] = value
    return found


def answers_card(study: Study) -> Html:
    """Return a row for each number, with the guess and what the best run of each solver found."""
    entries = [entry for entry in study.entries if any(math.isfinite(run.objective) for run in entry.runs)]
    best = [Study(study.problem, study.place, (entry,)).best for entry in entries]
    every = [variables_of(run) for run in best]
    if not any(every):
        return Html("")
    marks = palette.solver_marks(entry.solver for entry in study.entries)
    names = list(dict.fromkeys(variable.name for variables in every for variable in variables))
    rows = [row for name in names for row in variable_rows(name, every)]
    header = ["", *(tag("span", dot(marks[entry.solver][0]), entry.solver, class_="nowrap") for entry in entries)]
    more = f" The first {MOST_ROWS} of {len(rows)} numbers." if len(rows) > MOST_ROWS else ""
    seeds = " Of each solver the best seed." if any(len(entry.runs) > 1 for entry in entries) else ""
    content = table([*header, "guess"], rows[:MOST_ROWS], "t" + "n" * (len(entries) + 1), "What was found")
    note = f"{difference(entries, every)}{seeds}{more}".strip()
    return card("What was found", content, note=note)


def variable_rows(name: str, every: Sequence[Sequence[VariableRecord]]) -> list[list[Html | str]]:
    """Return the rows of a variable: one for each component, or one with ranges."""
    of_each = [next((each for each in variables if each.name == name), None) for variables in every]
    first = next(each for each in of_each if each is not None)
    sets = tag("small", " " + ", ".join(first.sets))
    if not is_listed(first):
        many = f"at {first.value.shape[1]} instants" if first.value.shape[1] > 1 else f"{len(first.value)} numbers"
        cells = ["" if each is None else extent(each.value, first.unit) for each in of_each]
        return [[join([tag("b", name), f" {many}", sets]), *cells, extent(first.guess, first.unit)]]
    rows: list[list[Html | str]] = []
    for k, label in enumerate(component_labels(first)):
        numbers = [None if each is None or k >= len(each.value) else each.value[k, 0] for each in of_each]
        cells = [
            "" if each is None else with_unit(show(float(each), 4), first.unit)
            for each in (*numbers, first.guess[k, 0])
        ]
        rows.append([join([tag("b", label), sets if k == 0 else ""]), *cells])
    return rows


def extent(values: Array, unit: str) -> str:
    """Write from where to where numbers go."""
    return with_unit(f"{show(float(values.min()))} to {show(float(values.max()))}", unit)


def difference(entries: Sequence[Entry], every: Sequence[Sequence[VariableRecord]]) -> str:
    """Say which solvers, of those that solved it, found other answers than the first of them; empty if none did."""
    solved = [(entry.solver, variables) for entry, variables in zip(entries, every, strict=True) if entry.solved]
    if len(solved) < 2:
        return ""
    (first, reference), *others = solved
    found = [solver for solver, variables in others if is_another(reference, variables)]
    if not found:
        return "All solvers that solved it found the same."
    named = writing.listed(found[:MOST_NAMED])
    return f"There are several answers: {named} found another than {first}."


def is_another(first: Sequence[VariableRecord], second: Sequence[VariableRecord]) -> bool:
    """Whether a number differs by more than a share of its variable's largest."""
    known = {variable.name: variable for variable in second}
    for variable in first:
        other = known.get(variable.name)
        if other is None or other.value.shape != variable.value.shape:
            return True
        size = max(float(np.abs(each).max(initial=0.0)) for each in (variable.value, other.value))
        apart = np.abs(variable.value / 2 - other.value / 2).max(initial=0.0)  # halves: a difference may overflow
        if float(apart) > ANOTHER / 2 * size:
            return True
    return False
