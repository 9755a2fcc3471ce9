"""Knots of a control on another grid, as the interpolation between them says."""

from __future__ import annotations

import numpy as np

from symphys.types import Array


def resampled(values: Array, before: str, count: int, after: str) -> Array:
    """(components, count) the control with other knots, at the same shares of the duration.

    Args:
        values: (components, knots).
        before: its interpolation: "constant", each knot over an equal part of the duration, or "linear", knots at equal
            distances from the start to the end.
        count: of the new knots.
        after: their interpolation. Linear knots are values of the control, whose constant parts are joined at their
            middles; constant ones are its means over their parts.
    """
    knots = values.shape[1]
    if knots == count and (before == after or count == 1):
        return values
    steps = before == "constant" or knots == 1
    if after == "linear" and count > 1:
        places = (np.arange(knots) + 0.5) / knots if steps else np.linspace(0, 1, knots)
        return np.stack([np.interp(np.linspace(0, 1, count), places, row) for row in values])
    edges = np.linspace(0, 1, count + 1)
    return np.stack([np.diff(step_areas(row, edges) if steps else line_areas(row, edges)) * count for row in values])


def step_areas(row: Array, edges: Array) -> Array:
    """The integral from 0 to the edges of steps of equal length over [0, 1]."""
    areas = np.concatenate([[0], np.cumsum(row)]) / len(row)
    return np.asarray(np.interp(edges, np.linspace(0, 1, len(row) + 1), areas))


def line_areas(row: Array, edges: Array) -> Array:
    """The integral from 0 to the edges of lines between numbers at equal distances over [0, 1]."""
    knots = np.linspace(0, 1, len(row))
    places = np.union1d(knots, edges)
    values = np.interp(places, knots, row)
    areas = np.concatenate([[0], np.cumsum(np.diff(places) * (values[1:] + values[:-1]) / 2)])
    return np.asarray(np.interp(edges, places, areas))
