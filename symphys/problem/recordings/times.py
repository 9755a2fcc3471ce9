"""The times of a recording: from a column or a rate, on the clock of the simulation."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np
from numpy.typing import NDArray

from symphys.problem.recordings.columns import RecordedColumns, RecordingFault
from symphys.problem.recordings.types import Recording
from symphys.problem.schema.recording import RecordingTable
from symphys.types import Array

TIME = "time"
LEAST = 2
"""Samples of a recording."""
MOST = 1e15
"""Steps: more are not told apart."""
SLACK = 1e-9
"""Relative, of the end of the simulation."""


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
    if last - first < LEAST:
        key = "files" if table.table is None else "table"
        raise RecordingFault(key, f"{where}: a recording has {LEAST} rows or more; this has one")
    name = time_column(table)
    if name is None:
        time = np.arange(last - first) / (table.rate or 1.0)
    else:
        with np.errstate(over="ignore"):
            time = columns.numbers(name, "time")[first:last] * table.time_factor
        check_order(time, columns, first, name)
    time = time - (time[0] if from_first_row(table) else 0.0) + table.offset
    if time[0] < -SLACK * duration:
        text = f"{where}: the time {time[0]:g} s is before the start of the simulation"
        raise RecordingFault("offset", f'{text}; add offset = {-time[0]:g}, or clock = "first row"')
    time = np.maximum(time, 0.0)
    kept = len(time) if table.until is None else int(np.searchsorted(time, table.until * (1 + SLACK), "right"))
    if kept < LEAST:
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
    return np.asarray(time <= duration * (1 + SLACK))


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
    return max(1, ceil(min(end / dt * (1 - SLACK), MOST)))


def steps_apart(time: Array, dt: float) -> float:
    """Return the median number of time steps between samples."""
    return float(np.median(np.diff(time))) / dt
