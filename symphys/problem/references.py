"""Trajectories that are given, which formulas name: columns of numbers over time, from files or tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Literal

import casadi as ca
import numpy as np

from symphys.model.world import NOTHING
from symphys.problem.reading.faults import Faults
from symphys.problem.reading.time_series import SeriesError, read_series, series_text, written
from symphys.problem.schema import Document
from symphys.types import Array, Expr

DELAY = "delay"


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
        """How formulas name its columns: ``walk.hip``."""
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
    """All of the [[reference]] tables, and the texts of their files by the names that they have there."""
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
    """What all names of references mean at a time [s]; ``delays`` by name [s], else as the file has them."""
    found: dict[str, Expr] = {}
    for each in references:
        late = delays.get(f"{each.name}.{DELAY}", each.delay)
        found |= each.at(time if each.delay is None else time - late)
    return found
