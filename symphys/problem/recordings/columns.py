"""Columns of numbers by name, whatever they come from, and where a row of them lies in a message."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from symphys.suggest import hint, quote
from symphys.types import Array


class RecordingFault(ValueError):
    """Why numbers are no recording.

    Attributes:
        key: of the [[recording]] table that it concerns, or the place below that table.
    """

    def __init__(self, key: str | tuple[str | int, ...], message: str) -> None:
        """Keep the key, and the message for the user."""
        self.key = (key,) if isinstance(key, str) else key
        super().__init__(message)


@dataclass(frozen=True, eq=False)
class RecordedColumns:
    """Columns of n numbers, NaN where one is missing.

    Attributes:
        label: the file, or "table".
        values: by name (n,), or (n, k) of an array.
        names: of all columns that there are, those that were not read too.
        first: how messages count the first row: 2 in a CSV file, below its header; 0 in arrays.
        from_zero: whether they count from 0, which they then say.
    """

    label: str
    values: Mapping[str, Array] = field(repr=False)
    names: tuple[str, ...]
    first: int
    from_zero: bool = False

    @property
    def count(self) -> int:
        """n."""
        return next((len(values) for values in self.values.values()), 0)

    def part(self, first: int, last: int) -> RecordedColumns:
        """The rows from ``first`` to before ``last``."""
        values = {name: column[first:last] for name, column in self.values.items()}
        return RecordedColumns(self.label, values, self.names, self.first + first, self.from_zero)

    def where(self, row: int, name: str = "") -> str:
        """``a.csv, row 17, column "x"``: a row, counted here from 0, as a message names it."""
        counted = " (from 0)" if self.from_zero else ""
        column = f", column {quote(name)}" if name else ""
        return f"{self.label}, row {row + self.first}{counted}{column}"

    def require(self, names: Iterable[str], key: str | tuple[str | int, ...]) -> None:
        """RecordingFault with the nearest names where one of these is missing."""
        for name in names:
            if name not in self.names:
                nearest = hint(name, self.names)
                raise RecordingFault(key, f"{self.label} has no column {quote(name)}; {nearest}")

    def numbers(self, name: str, key: str | tuple[str | int, ...]) -> Array:
        """(n,): a column with one number in each row."""
        self.require([name], key)
        values = self.values[name]
        if values.ndim == 2 and values.shape[1] == 1:
            return values[:, 0]
        if values.ndim != 1:
            text = f"has {values.shape[1]} numbers in each row; one is wanted"
            raise RecordingFault(key, f"{self.label}: {quote(name)} {text}")
        return values

    def side_by_side(self, names: Sequence[str], key: str | tuple[str | int, ...]) -> Array:
        """(n, m): columns and arrays beside each other, a copy."""
        self.require(names, key)
        return np.column_stack([self.values[name] for name in names])
