"""From columns to quantities of the engine: units, order of quaternions, the frame of the measurement system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symphys.dynamics.observation import SENSOR_KINDS
from symphys.maths import rotation
from symphys.model.state_layout import INPUT_FIELDS
from symphys.problem.recordings.columns import RecordedColumns, RecordingFault
from symphys.problem.schema.recording import CONVERSIONS, ColumnsTable
from symphys.suggest import quote
from symphys.types import Array

Key = tuple[str | int, ...]
PLACED = "position"
"""The field of quantities that a frame turns and shifts; points of space."""
TURNED = frozenset({*INPUT_FIELDS, *(kind.key for kind in SENSOR_KINDS if kind.axes == "world")} - {PLACED})
"""Fields of vectors in world coordinates, which a frame turns."""
ORIENTATION = "orientation"
LARGEST = 1e30
"""In the unit of the engine: larger numbers mark what is missing in some programs, and have no finite squares."""
LENGTH = "m"
"""The unit of lengths."""
OFF = 1e-2
"""By how much the length of a quaternion may differ from 1."""


@dataclass(frozen=True, eq=False)
class MeasurementFrame:
    """Where the measurement system lies in the world: origin (3,) [m] and unit quaternion (4,) of its axes."""

    position: Array
    orientation: Array


def convert(
    columns: RecordedColumns,
    names: Sequence[str],
    table: ColumnsTable,
    quantity: str,
    size: int,
    frame: MeasurementFrame | None,
    key: Key,
) -> Array:
    """(n, size): a quantity in the units and the frame of the world.

    Args:
        columns: what was read.
        names: of the columns.
        table: units and order.
        quantity: its name, such as ``cube.position``; empty for another formula.
        size: how many numbers it has.
        frame: of the measurement system; None: that of the world.
        key: for messages.
    """
    values = columns.side_by_side(names, key)
    if values.shape[1] != size:
        wanted = "one number" if size == 1 else f"{size} numbers"
        text = f"{columns.label}: {', '.join(map(quote, names))} have {values.shape[1]} numbers in each row"
        raise RecordingFault(key, f"{text}; {quantity or 'the formula'} has {wanted}")
    field = quantity.rpartition(".")[2]
    if field == ORIENTATION and size == 4:
        values = unit_quaternions(values, table, columns, names, key)
        return values if frame is None else turned_quaternions(frame.orientation, values)
    with np.errstate(over="ignore"):
        values *= table.factor if table.unit is None else CONVERSIONS[table.unit][0]
        values += table.offset
    infinite = np.argwhere(np.isinf(values))
    if infinite.size:
        raise RecordingFault(
            key, f"{columns.where(int(infinite[0][0]))}: the number is not finite, after factor and offset"
        )
    large = np.argwhere(np.abs(values) > LARGEST)
    if large.size:
        row, column = (int(k) for k in large[0])
        text = f"the number {values[row, column]:g} is no measurement; a missing one is nan, or an empty cell"
        raise RecordingFault(key, f"{columns.where(row)}: {text}")
    if frame is not None and size == 3 and field in (PLACED, *TURNED):
        values = values @ np.array(rotation.matrix(frame.orientation), float).T
        values += frame.position if field == PLACED else 0.0
    return values


def unit_quaternions(
    values: Array, table: ColumnsTable, columns: RecordedColumns, names: Sequence[str], key: Key
) -> Array:
    """(n, 4): w x y z of length 1; a row with a missing number is missing whole."""
    if table.quaternion == "xyzw":
        values = values[:, [3, 0, 1, 2]]
    length = np.sqrt(np.einsum("nk,nk->n", values, values))
    wrong = np.flatnonzero(np.abs(length - 1) > OFF)
    if wrong.size:
        row = int(wrong[0])
        numbers = ", ".join(f"{value:g}" for value in columns.side_by_side(names, key)[row])
        text = f"{columns.where(row)}: [{numbers}] is no unit quaternion, its length is {length[row]:.4g}"
        raise RecordingFault(key, f"{text}; four numbers w, x, y, z of length 1 are wanted")
    return np.asarray(values / length[:, None])


def turned_quaternions(turn: Array, values: Array) -> Array:
    """(n, 4): the products of a quaternion and those of each row, which act first."""
    w, x, y, z = turn
    product = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return np.asarray(values @ product.T)


def check_table(table: ColumnsTable, unit: str, quantity: str, key: Key) -> None:
    """RecordingFault where the unit of the columns is another kind than that of the quantity, as far as it is known."""
    if table.unit is not None and table.factor != 1:
        raise RecordingFault((*key, "factor"), "stands instead of unit; leave one of them out")
    base = None if table.unit is None else CONVERSIONS[table.unit][1]
    if base is not None and unit and base != unit:
        fitting = ", ".join(map(quote, (name for name, (_, of) in CONVERSIONS.items() if of == unit)))
        raise RecordingFault((*key, "unit"), f"{quantity} is in {unit}; valid: {fitting or 'none, use factor'}")
    if quantity.endswith(f".{ORIENTATION}") and (table.unit is not None or table.factor != 1 or table.offset):
        which = "unit" if table.unit is not None else "factor" if table.factor != 1 else "offset"
        raise RecordingFault((*key, which), "a unit quaternion has none; leave this out")
