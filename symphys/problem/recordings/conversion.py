"""Conversion of columns to quantities: times, units, order of quaternions, the frame of the measurement system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil

import numpy as np
from numpy.typing import NDArray

from symphys.dynamics.observation import SENSOR_KINDS
from symphys.maths import rotation
from symphys.model.state_layout import INPUT_FIELDS
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.recordings.columns import RecordedColumns, RecordingFault
from symphys.problem.recordings.types import Recording
from symphys.problem.schema.recording import CONVERSIONS, ColumnsTable, RecordingTable
from symphys.records import dataclass
from symphys.suggest import quote
from symphys.types import Array

TIME = "time"
MIN_ROWS = 2
"""Samples of a recording."""
MAX_STEPS = 1e15
"""Steps: more are not told apart."""
TIME_TOLERANCE = 1e-9
"""Relative, of the end of the simulation."""
Key = tuple[str | int, ...]
PLACED = "position"
"""The field of quantities that a frame turns and shifts; points of space."""
TURNED = frozenset({*INPUT_FIELDS, *(kind.key for kind in SENSOR_KINDS if kind.axes == "world")} - {PLACED})
"""Fields of vectors in world coordinates, which a frame turns."""
ORIENTATION = "orientation"
MAX_MEASUREMENT = 1e30
"""In the unit of the engine: larger numbers mark what is missing in some programs, and have no finite squares."""
LENGTH = "m"
"""The unit of lengths."""
MAX_LENGTH_ERROR = 1e-2
"""By how much the length of a quaternion may differ from 1."""
MAX_LENGTH_RATIO = 30.0
"""Lengths that exceed what the world has by this factor are in another unit."""
MAX_RATIO_ERROR = 3.0
"""How far a ratio of lengths may be off 100 or 1000. That to an upper bound is less than the factor of the unit."""
START_SHARE = 0.05
"""Share of the recording in which its first sample is compared with the start of the simulation."""
MIN_LENGTH = 1e-3
"""[m] of the start; what is smaller has no ratio."""


def time_column(table: RecordingTable) -> str | None:
    """The name of the column of times; None where a rate says them."""
    return table.time if table.rate is not None else table.time or TIME


def read_times(
    columns: RecordedColumns, first: int, last: int, table: RecordingTable, duration: float
) -> tuple[Array, int]:
    """(n,) [s] the times of the rows from ``first`` to before ``last``, and how many rows at the end are left out.

    Raises:
        RecordingFault: names the row of a time that is missing, does not come after the one before, or lies before
            the simulation.
    """
    where = columns.where(first)
    if last - first < MIN_ROWS:
        key = "files" if table.table is None else "table"
        raise RecordingFault(key, f"{where}: a recording has {MIN_ROWS} rows or more; this has one")
    name = time_column(table)
    if name is None:
        time = np.arange(last - first) / (table.rate or 1.0)
    else:
        with np.errstate(over="ignore"):
            time = columns.numbers(name, "time")[first:last] * table.time_factor
        check_order(time, columns, first, name)
    time = time - (time[0] if from_first_row(table) else 0.0) + table.offset
    if time[0] < -TIME_TOLERANCE * duration:
        text = f"{where}: the time {time[0]:g} s is before the start of the simulation"
        raise RecordingFault("offset", f'{text}; add offset = {-time[0]:g}, or clock = "first row"')
    time = np.maximum(time, 0.0)
    kept = len(time) if table.until is None else int(np.searchsorted(time, table.until * (1 + TIME_TOLERANCE), "right"))
    if kept < MIN_ROWS:
        raise RecordingFault("until", f"{where}: only {kept} samples of this recording are before {table.until:g} s")
    found = np.where(within(time[:kept], duration), np.minimum(time[:kept], duration), time[:kept])
    if np.any(np.diff(found) <= 0):
        text = f"{where}: the differences of times are lost in their size"
        raise RecordingFault("offset", f'{text}; take clock = "first row", or look at time_factor and rate')
    return found, len(time) - kept


def from_first_row(table: RecordingTable) -> bool:
    """Whether the first row of each recording is at 0 s, before the offset."""
    if table.clock is not None:
        return table.clock == "first row"
    return bool(table.start) or table.rows is not None or table.split is not None


def check_order(time: Array, columns: RecordedColumns, first: int, name: str) -> None:
    """Times are numbers, each after the one before."""
    unknown = np.flatnonzero(~np.isfinite(time))
    if unknown.size:
        row = int(unknown[0])
        text = "missing" if np.isnan(time[row]) else "not finite, after time_factor"
        raise RecordingFault("time", f"{columns.where(first + row, name)}: the time is {text}")
    wrong = np.flatnonzero(np.diff(time) <= 0)
    if wrong.size:
        row = int(wrong[0]) + 1
        same = time[row] == time[row - 1]
        text = f"the time {time[row]:.9g} s " + ("occurs twice" if same else f"comes after {time[row - 1]:.9g} s")
        advice = "delete the row" if same else "sort the rows, or split them into recordings (split, rows)"
        raise RecordingFault("time", f"{columns.where(first + row, name)}: {text}; {advice}")


def within(time: Array, duration: float) -> NDArray[np.bool_]:
    """(n,): whether times are not after the end of the simulation, but for rounding."""
    return np.asarray(time <= duration * (1 + TIME_TOLERANCE))


def check_ends(recordings: Sequence[Recording], duration: float, dt: float) -> None:
    """RecordingFault with the duration that is needed, where a recording goes on after the end of the simulation."""
    longest = max(recordings, key=lambda each: float(each.time[-1]))
    end = float(longest.time[-1])
    if within(longest.time[-1:], duration).all():
        return
    late = sum(not within(each.time[-1:], duration).all() for each in recordings)
    others = f" (as do {late - 1} others)" if late > 1 else ""
    text = f"{longest.source}: samples go on to {end:.6g} s{others}, and the simulation ends at {duration:g} s"
    if min(float(each.time[0]) for each in recordings) > duration:
        raise RecordingFault("clock", f'{text}; take clock = "first row", by which each recording begins at 0 s')
    needed = steps_until(end, dt) * dt
    raise RecordingFault(
        "until",
        f"{text}; [simulation] needs duration = {needed:.10g}, or leave later ones out with until = {duration:g}",
    )


def steps_until(end: float, dt: float) -> int:
    """The time steps after which a sample at ``end`` [s] lies within the simulation, at least one."""
    return max(1, ceil(min(end / dt * (1 - TIME_TOLERANCE), MAX_STEPS)))


def steps_apart(time: Array, dt: float) -> float:
    """Return the median number of time steps between samples."""
    return float(np.median(np.diff(time))) / dt


@dataclass(frozen=True, eq=False)
class MeasurementFrame:
    """The frame of the measurement system in the world: origin (3,) [m] and unit quaternion (4,) of its axes."""

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
    large = np.argwhere(np.abs(values) > MAX_MEASUREMENT)
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
    wrong = np.flatnonzero(np.abs(length - 1) > MAX_LENGTH_ERROR)
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


def longest(parametric: ParametricWorld, initial: Mapping[str, Array], duration: float) -> float:
    """[m]: a length that nothing in the world exceeds by far: sizes, places, and the way of a fall in that time."""
    world = parametric.world({})
    extents = [float(shape.extent) for body in world.bodies for shape in body.shapes]
    places = [float(np.linalg.norm(value)) for name, value in initial.items() if name.endswith(".position")]
    speeds = [float(np.linalg.norm(value)) for name, value in initial.items() if name.endswith(".velocity")]
    fall = float(np.linalg.norm(parametric.gravity)) * duration**2 / 2
    return max([*extents, *places, MIN_LENGTH]) + max([*speeds, 0.0]) * duration + fall


def check_lengths(
    values: Array, at_start: Array | None, time: Array, world_length: float, where: str, key: tuple[str | int, ...]
) -> None:
    """RecordingFault where lengths are 100 or 1000 times those of the world.

    Args:
        values: (n, m) [m] as they were read.
        at_start: (m,) [m] of the simulation; None where the start is not given by the file.
        time: (n,) [s].
        world_length: see ``longest``.
        where: for messages.
        key: that has the unit.
    """
    size = np.linalg.norm(values, axis=1)
    known = size[np.isfinite(size)]
    if not known.size:
        return
    ratio, limit = float(np.median(known)) / world_length, 100.0
    compared = f"lengths in this world, up to about {world_length:.3g} m"
    if at_start is not None and np.isfinite(size[0]) and time[0] <= START_SHARE * time[-1]:
        begin = float(np.linalg.norm(at_start))
        if begin > MIN_LENGTH and size[0] / begin > MAX_LENGTH_RATIO:
            ratio, limit, compared = (
                size[0] / begin,
                100 * MAX_RATIO_ERROR,
                f"the start of the simulation, {begin:.3g} m",
            )
    if ratio <= MAX_LENGTH_RATIO:
        return
    factor, unit = (0.001, "mm") if ratio > limit else (0.01, "cm")
    name = "millimetres" if unit == "mm" else "centimetres"
    text = f"{where}: the numbers are {ratio:.0f} times {compared}; metres are wanted"
    raise RecordingFault(key, f'{text}; are these {name}? unit = "{unit}", or factor = {factor:g}')
