"""Which columns set something of the simulation: the keys ``start`` and ``inputs`` of [[recording]]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from symphys.problem.recordings.columns import RecordedColumns, RecordingFault
from symphys.problem.recordings.conversion import MeasurementFrame, check_table, convert
from symphys.problem.recordings.starts import Starts
from symphys.problem.recordings.types import RecordedInput
from symphys.problem.schema.recording import ColumnsTable, InputTable, RecordingTable, leaves
from symphys.suggest import hint, quote
from symphys.types import Array


@dataclass(frozen=True)
class StartColumns:
    """A quantity that the first row sets: its name, its columns and their units, how many numbers, and the unit."""

    quantity: str
    table: ColumnsTable
    size: int

    def first_row(self, rows: RecordedColumns, frame: MeasurementFrame | None) -> Array:
        """(size,): what the first row of a recording has; RecordingFault where a number is missing."""
        key = ("start", self.quantity)
        rows.require(self.table.columns, key)
        value: Array = convert(rows.part(0, 1), self.table.columns, self.table, self.quantity, self.size, frame, key)[0]
        if not np.isfinite(value).all():
            raise RecordingFault(key, f"{rows.where(0)}: the first row lacks a number of {self.quantity}")
        return value


@dataclass(frozen=True)
class InputColumns:
    """An input that was recorded: its name, its columns with their units, and how many numbers it has."""

    name: str
    table: InputTable
    size: int

    def over_time(self, rows: RecordedColumns, time: Array, frame: MeasurementFrame | None) -> RecordedInput:
        """The input of a recording with times (n,) [s]; RecordingFault where no row has its numbers."""
        key = ("inputs", self.name)
        values = convert(rows, self.table.columns, self.table, self.name, self.size, frame, key)[: len(time)]
        known = np.isfinite(values).all(axis=1)
        if not known.any():
            raise RecordingFault(key, f"{rows.where(0)}: no row from this one on has the numbers of {self.name}")
        return RecordedInput(
            time[known], values[known], self.table.interpolation, self.table.delay, int(np.sum(~known))
        )


def read_input_columns(table: RecordingTable, sizes: Mapping[str, int], units: Mapping[str, str]) -> list[InputColumns]:
    """What ``inputs`` says; ``sizes`` of all inputs by name."""
    found = list[InputColumns]()
    for name, columns in table.input_tables.items():
        key = ("inputs", name)
        if name not in sizes:
            text = f"a recording cannot drive {quote(name)}, but forces and torques on bodies and commands of motors"
            raise RecordingFault(key, f"{text}; {hint(name, sizes)}")
        check_table(columns, units.get(name, ""), name, key)
        found.append(InputColumns(name, columns, sizes[name]))
    return found


def read_start_columns(
    table: RecordingTable, sample: Mapping[str, Any], units: Mapping[str, str], starts: Starts
) -> list[StartColumns]:
    """What ``start`` says, with the units that the same columns have in ``measured``."""
    known = {name: value.size for name, value in starts.initial.items()}
    known |= dict.fromkeys(starts.of_joints, 1)
    found = list[StartColumns]()
    for quantity, given in leaves(table.start):
        key = ("start", quantity)
        if quantity not in known:
            text = f"a recording cannot set {quote(quantity)} at the start; {hint(quantity, known)}"
            raise RecordingFault(key, text)
        try:
            columns = ColumnsTable.model_validate(given if isinstance(given, Mapping) else {"columns": given})
        except ValidationError as error:
            text = str(error.errors(include_url=False)[0]["msg"])
            raise RecordingFault(
                key, f'{text}; write "position", ["x", "y", "z"] or {{ columns = "x", unit = "mm" }}'
            ) from None
        if not isinstance(given, Mapping):
            columns = next((as_columns(each) for each in table.measured if each.columns == columns.columns), columns)
        check_table(columns, units.get(quantity, ""), quantity, key)
        found.append(StartColumns(quantity, columns, known[quantity]))
    return found


def as_columns(table: ColumnsTable) -> ColumnsTable:
    """Its columns and units alone."""
    return ColumnsTable(**{key: getattr(table, key) for key in ColumnsTable.model_fields})
