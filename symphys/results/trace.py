"""trace.csv: a row for each iteration of a solve, written and read by the same names of columns."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from symphys import json_values as values
from symphys.files import check_regular
from symphys.records import dataclass
from symphys.results.text_files import reason
from symphys.types import Array

OUTPUT = "output: "
"""Prefix of columns with reported quantities of the problem and of the solver."""
OLD_OUTPUT = "told: "
"""The prefix in older files."""
OLD_NAMES = {"miss": "max_violation"}
"""Present names by the names of columns in older files."""


def renamed(column: str) -> str:
    """Return the name that a column of an older file has now."""
    if column.startswith(OLD_OUTPUT):
        return OUTPUT + column.removeprefix(OLD_OUTPUT)
    return OLD_NAMES.get(column, column)


@dataclass(frozen=True)
class Trace:
    """The iterations of a solve, column by column; a column that the file lacks is all nan.

    | column | row by row |
    |---|---|
    | iteration | its number |
    | rollouts, gradients, jacobians, hessians | evaluations so far |
    | seconds | wall time so far |
    | objective, max_violation | of this iteration's point, at its smoothing; the largest error / tolerance |
    | best | lowest merit so far, as the solver counts it |
    | gradient_norm, step | as the solver defines them |
    | smoothing | of the contacts [m/s] |
    | equivalents | cost of all evaluations so far, in rollouts |
    | output: NAME | a reported quantity of the best point so far, or of the solver's iteration |

    Attributes:
        columns: name -> (rows,).
        rows: how many.
    """

    columns: Mapping[str, Array]
    rows: int

    def __getitem__(self, name: str) -> Array:
        """Return (rows,) the column called ``name``."""
        return self.columns.get(name, np.full(self.rows, np.nan))

    @property
    def outputs(self) -> list[str]:
        """Return the names of the reported quantities."""
        return [name.removeprefix(OUTPUT) for name in self.columns if name.startswith(OUTPUT)]


def trace_text(rows: Iterable[Mapping[str, object]]) -> str:
    """Return a line for each row under a header with the names of the columns; what a row lacks is nan."""
    rows = [{renamed(key): value for key, value in row.items()} for row in rows]
    columns = list(dict.fromkeys(key for row in rows for key in row))
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, columns, restval="nan", lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: repr(value) for key, value in row.items()} for row in rows)
    return buffer.getvalue()


def read_trace(path: Path, faults: list[str]) -> Trace:
    """Read the columns of trace.csv; rows that are cut short are left out, which ``faults`` then says."""
    try:
        check_regular(path)
        with path.open(encoding="utf-8", errors="replace", newline="") as file:
            rows = list(csv.reader(file))
    except OSError as error:
        faults.append(f"{path.name}: {reason(error)}")
        return Trace({}, 0)
    except csv.Error as error:
        faults.append(f"{path.name}: {values.name(str(error))}")
        return Trace({}, 0)
    header = [renamed(values.name(title)) for title in rows[0]] if rows else []
    whole = [row for row in rows[1:] if len(row) == len(header)]
    if len(whole) < len(rows) - 1:
        faults.append(f"{path.name}: {len(rows) - 1 - len(whole)} row(s) cut short, left out")
    columns = {title: np.array([values.number(row[i]) for row in whole], float) for i, title in enumerate(header)}
    return Trace(columns, len(whole))
