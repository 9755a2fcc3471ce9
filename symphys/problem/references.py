"""Trajectories that are given, which formulas name: columns of numbers over time, from files or tables."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from itertools import pairwise
from pathlib import Path
from typing import Literal

import casadi as ca
import numpy as np

from symphys.archives import ArchiveError, read_arrays
from symphys.errors import ProblemError
from symphys.files import check_regular
from symphys.model.world import NOTHING
from symphys.problem.reading.faults import Faults
from symphys.problem.reading.source import MAX_NUMBER, TOO_LARGE, read_source
from symphys.problem.schema import Document
from symphys.problem.schema.checks import IDENTIFIER
from symphys.records import dataclass
from symphys.suggest import quote
from symphys.types import Array, Expr

TIME = "time"
MIN_ROWS, MAX_ROWS = 2, 1000
"""Each row is looked at in every evaluation of a formula."""
MAX_BYTES = 10**7
"""[bytes] Largest memory of the arrays of an NPZ file: a thousand rows of a thousand columns."""
DELAY = "delay"


class SeriesError(ValueError):
    """Columns that are no time series."""


def series_text(path: Path) -> str:
    """The content of a file as text of a CSV file; SeriesError if there is no such file, or one of another kind."""
    try:
        if path.suffix.lower() != ".npz":
            return read_source(path)
        check_regular(path)
        with path.open("rb") as file:
            _, columns = read_arrays(file, most=MAX_BYTES)
    except ProblemError as error:
        raise SeriesError(f"{path}: {error.issues[0].message}") from None
    except (OSError, ArchiveError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SeriesError(f"{path} cannot be read: {reason}") from None
    for name, column in columns.items():
        if column.dtype.kind not in "fiu" or column.ndim != 1:
            raise SeriesError(f"{path}, array {quote(name)}: must be numbers, one for each time, not {column.shape}")
        if column.size > MAX_ROWS:
            raise SeriesError(f"{path} has {column.size} rows of numbers; {MIN_ROWS} to {MAX_ROWS} are allowed")
    return written({name: column.tolist() for name, column in columns.items()}, str(path))


def written(columns: Mapping[str, Sequence[float]], file: str) -> str:
    """The text of a CSV file with these columns."""
    if len({len(column) for column in columns.values()}) > 1:
        sizes = ", ".join(f"{name} {len(column)}" for name, column in columns.items())
        raise SeriesError(f"{file}: all columns need as many numbers; there are: {sizes}")
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"


def read_series(text: str, file: str) -> tuple[Array, dict[str, Array]]:
    """Times (n,) [s], and by name the numbers (n,) at these times, of the text of a CSV file."""
    lines = [line for line in csv.reader(io.StringIO(text)) if any(cell.strip() for cell in line)]
    header = [cell.strip() for cell in lines[0]]
    for name in header:
        if not re.fullmatch(IDENTIFIER, name):
            raise SeriesError(f"{file}, row 1: {quote(name)} is no name of a column; write time,hip,knee")
    if len(set(header)) < len(header) or TIME not in header or len(header) < 2:
        raise SeriesError(f"{file}, row 1: the columns are {', '.join(header)}; one {TIME} and others are needed")
    if not MIN_ROWS <= len(lines) - 1 <= MAX_ROWS:
        raise SeriesError(f"{file} has {len(lines) - 1} rows of numbers; {MIN_ROWS} to {MAX_ROWS} are allowed")
    values = np.empty((len(lines) - 1, len(header)))
    for k, line in enumerate(lines[1:]):
        if len(line) != len(header):
            raise SeriesError(f"{file}, row {k + 2}: {len(line)} numbers, but the header has {len(header)} columns")
        for place, (name, cell) in enumerate(zip(header, line, strict=True)):
            values[k, place] = number(cell, f"{file}, row {k + 2}, column {quote(name)}")
    time = values[:, header.index(TIME)]
    for k in np.flatnonzero(np.diff(time) <= 0)[:1]:
        raise SeriesError(f"{file}, row {k + 3}: the time {time[k + 1]:g} does not come after {time[k]:g}")
    columns = {name: values[:, column] for column, name in enumerate(header) if name != TIME}
    for name, column in columns.items():
        with np.errstate(over="ignore"):
            rates = np.abs(np.diff(column)) / np.diff(time)
        for k in np.flatnonzero(~((rates <= MAX_NUMBER) & (np.diff(time) >= 1 / MAX_NUMBER)))[:1]:
            text = f"{column[k]:g} becomes {column[k + 1]:g} within {time[k + 1] - time[k]:g} s"
            raise SeriesError(f"{file}, row {k + 3}, column {quote(name)}: {text}, too fast to be computed with")
    return time, columns


def number(cell: str, where: str) -> float:
    """A finite number; SeriesError that says where it is none."""
    try:
        value = float(cell)
    except ValueError:
        raise SeriesError(f"{where}: {quote(cell.strip())} is no number") from None
    if not np.isfinite(value):
        raise SeriesError(f"{where}: {quote(cell.strip())} is not finite")
    if abs(value) > MAX_NUMBER:
        raise SeriesError(f"{where}: {quote(cell.strip())} {TOO_LARGE}")
    return value


@dataclass(frozen=True)
class ReferenceTrajectory:
    """A trajectory, piecewise linear or cubic in time; before its first and after its last time it stays.

    Attributes:
        name: as in the file.
        time: (n,) [s], increasing.
        columns: by name (n,).
        interpolation: "cubic" is the spline with continuous curvature ("not a knot" at its ends).
        delay: by which formulas read it late [s], a number that variables may set; None where the file states none.
    """

    name: str
    time: Array = field(repr=False)
    columns: dict[str, Array] = field(repr=False)
    interpolation: Literal["linear", "cubic"] = "linear"
    delay: float | None = None

    @property
    def weights(self) -> dict[str, Array]:
        """Its delay by name, (1,) [s], if the file states one."""
        return {} if self.delay is None else {f"{self.name}.{DELAY}": np.array([self.delay])}

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of its columns in formulas: ``walk.hip``."""
        return tuple(f"{self.name}.{column}" for column in self.columns)

    def at(self, time: Expr) -> dict[str, Expr]:
        """The numbers at a time [s], by the names of formulas.

        Each of the n times has a weight w that falls from 1 to 0 until its neighbours. Linear: the sum of w y. Cubic:
        the sum of w^2 (3 - 2 w) y + w^2 (t - t_i) y', Hermite's polynomials.
        """
        t = self.time
        now = ca.fmin(ca.fmax(time, t[0]), t[-1])
        rise = [None, *((now - a) / (b - a) for a, b in pairwise(t))]
        weights = []
        for i in range(len(t)):
            sides = [] if i == 0 else [rise[i]]
            sides += [] if i + 1 == len(t) else [1 - rise[i + 1]]
            weights.append(ca.fmax(sides[0] if len(sides) == 1 else ca.fmin(*sides), 0))
        if self.interpolation == "linear":
            terms = {name: zip(weights, y.tolist(), strict=True) for name, y in self.columns.items()}
            return {f"{self.name}.{name}": sum(w * y for w, y in parts) for name, parts in terms.items()}
        places = [w**2 * (3 - 2 * w) for w in weights]
        slopes = [w**2 * (now - at) for w, at in zip(weights, t.tolist(), strict=True)]
        found = {}
        for name, y in self.columns.items():
            from scipy.interpolate import CubicSpline  # takes a third of a second: late, for those who have splines

            rates = CubicSpline(t, y)(t, 1)
            parts = zip(places, y.tolist(), slopes, rates.tolist(), strict=True)
            found[f"{self.name}.{name}"] = sum(w * value + v * rate for w, value, v, rate in parts)
        return found


def read_references(document: Document, faults: Faults) -> tuple[tuple[ReferenceTrajectory, ...], dict[str, str]]:
    """Read the [[reference]] tables; return them, and the texts of their files by the names that they have there."""
    kept = {table.file: table.text for table in document.included}
    found, texts = list[ReferenceTrajectory](), dict[str, str]()
    for index, table in enumerate(document.reference):
        place = ("reference", index)
        if (table.file is None) == (table.table is None):
            faults.add((*place, "file"), "give either file (a CSV or NPZ file) or table (columns of numbers)")
            continue
        key, label = ("table", "table") if table.file is None else ("file", table.file)
        try:
            if table.file is None:
                text = written(table.table or {}, label)
            elif table.file in kept:
                text = kept[table.file]
            else:
                text = series_text(Path(faults.origin(place).file).parent / table.file)
                if texts.setdefault(table.file, text) != text:
                    raise SeriesError(f"{table.file}: another file of this name holds other numbers; rename one")
            time, columns = read_series(text, label)
        except SeriesError as error:
            faults.add((*place, key), str(error))
            continue
        if table.delay is not None and DELAY in columns:
            faults.add((*place, DELAY), "there is a column of this name, so formulas would not know which; rename that")
        found.append(ReferenceTrajectory(table.name, time, columns, table.interpolation, table.delay))
    return tuple(found), texts


def reference_values(
    references: Iterable[ReferenceTrajectory], time: Expr, delays: Mapping[str, Expr] = NOTHING
) -> Mapping[str, Expr]:
    """Evaluate all names of references at a time [s]; ``delays`` by name [s] replace those of the file."""
    found: dict[str, Expr] = {}
    for each in references:
        late = delays.get(f"{each.name}.{DELAY}", each.delay)
        found |= each.at(time if each.delay is None else time - late)
    return found
