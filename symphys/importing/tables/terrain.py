"""Height fields as [[terrain]] tables."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from symphys.importing.tables.reading import ModelReading, numbers
from symphys.model.heightfield import Heightfield
from symphys.types import Array

MOST_HEIGHTS = 1024
"""That a terrain may have: each is in every contact with it, in every step."""
FLAT = 1e-9
"""[m]: heights that differ by less make a plane."""


def terrain(reading: ModelReading, geom: int, place: Array, axes: Array, found: dict[str, Any]) -> None:
    """A height field that is not turned: its heights are rows along y and columns along x, about the geom."""
    model, field = reading.model, int(reading.model.geom_dataid[geom])
    what = reading.called("geom", geom)
    if np.abs(axes - np.eye(3)).max() > 1e-12:
        reading.note("left out", what, "a height field that is turned has no counterpart")
        return
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    start = int(model.hfield_adr[field])
    shares = np.array(model.hfield_data[start : start + rows * columns], float).reshape(rows, columns)
    x, y, top, _ = (float(value) for value in model.hfield_size[field])
    heights = place[2] + top * shares
    if float(np.ptp(heights)) <= FLAT:
        name = reading.names.give("plane", reading.name("geom", geom), "plane")
        reading.static_names[geom] = name
        reading.note("approximated", what, "all its heights are the same, so it is a plane, which has no edges")
        found["plane"].append({"name": name, "normal": [0.0, 0.0, 1.0], "point": numbers([*place[:2], heights[0, 0]])})
        return
    name = reading.names.give("terrain", reading.name("geom", geom), "terrain")
    reading.static_names[geom] = name
    kept = thinned(heights)
    text = "a smooth surface through its heights, which goes straight on; MuJoCo's is made of triangles, and ends"
    if kept.shape != heights.shape:
        text = f"{rows} x {columns} heights are thinned to {kept.shape[0]} x {kept.shape[1]}; {text}"
    spacing = [2 * x / (kept.shape[1] - 1), 2 * y / (kept.shape[0] - 1)]
    origin = [place[0] - x, place[1] - y]
    surface = Heightfield(tuple(map(tuple, kept.tolist())), (spacing[0], spacing[1]), (origin[0], origin[1]))
    off = f"the surfaces differ by at most {1e3 * surface.off_triangles(heights):.3g} mm"
    reading.note("approximated", what, text, off)
    table = {"name": name, "heights": numbers(kept), "spacing": numbers(spacing), "origin": numbers(origin)}
    found["terrain"].append(table)


def thinned(heights: Array) -> Array:
    """At most ``MOST_HEIGHTS`` heights over the same area."""
    rows, columns = heights.shape
    if rows * columns <= MOST_HEIGHTS:
        return heights
    shrink = sqrt(MOST_HEIGHTS / (rows * columns))
    few = min(max(2, int(rows * shrink)), MOST_HEIGHTS // 2)
    return resampled(heights, few, min(columns, MOST_HEIGHTS // few))


def resampled(heights: Array, rows: int, columns: int) -> Array:
    """(rows, columns): linear between neighbours."""
    y, x = (np.linspace(0, size - 1, count) for size, count in zip(heights.shape, (rows, columns), strict=True))
    along = np.array([np.interp(x, np.arange(heights.shape[1]), row) for row in heights])
    return np.array([np.interp(y, np.arange(heights.shape[0]), column) for column in along.T]).T
