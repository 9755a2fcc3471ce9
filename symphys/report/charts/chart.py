"""A chart: panels of lines as numbers, which ``curves.js`` draws; small, and made without matplotlib."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symphys.report.figures.style import thin
from symphys.types import Array

POINTS = 240
"""Samples of a line at most about: a panel is some 300 pixels wide."""
STEPS = 4000
"""Numbers of a linear panel are rounded to this share of their range; a panel is some 150 pixels high."""
DIGITS = 4


@dataclass(frozen=True)
class Line:
    """A line of a panel.

    Attributes:
        name: what it shows; empty for one that only accompanies another.
        colour: as CSS writes it.
        x, y: (samples,); nan is a gap.
        width: [px].
        look: "" for a line, "steps" (a value holds until the next), "dashed", "pale", "dots", "rings".
    """

    name: str
    colour: str
    x: Array
    y: Array
    width: float = 1.4
    look: str = ""


@dataclass(frozen=True)
class Bars:
    """A row of bars: from when until when something holds; ``note`` stands at its end."""

    name: str
    colour: str
    spans: tuple[tuple[float, float], ...]
    note: str = ""


@dataclass(frozen=True)
class Panel:
    """One set of axes.

    Attributes:
        title: what it shows, with the unit.
        lines: in the order in which they are drawn.
        along: title of the horizontal axis.
        scale: 0 for linear, -1 for logarithmic, else linear up to this size and logarithmic beyond.
        edges: horizontal lines at these heights, such as bounds.
        met: whether what is at 1 or below is met, which is marked.
        least: (low, high) that the vertical axis shows at least; empty for what the lines need.
        bars: rows of bars in place of lines.
        ticks: marks along the bottom.
    """

    title: str
    lines: tuple[Line, ...] = ()
    along: str = ""
    scale: float = 0.0
    edges: tuple[float, ...] = ()
    met: bool = False
    least: tuple[float, ...] = ()
    bars: tuple[Bars, ...] = ()
    ticks: tuple[float, ...] = ()


@dataclass(frozen=True)
class Chart:
    """Panels side by side, row after row.

    Attributes:
        name: what a figure with the same content is called.
        alt: says what it shows.
        panels: None is an empty place.
        columns: panels in a row.
        keys: (name, colour) of what the colours mean.
    """

    name: str
    alt: str
    panels: tuple[Panel | None, ...]
    columns: int = 1
    keys: tuple[tuple[str, str], ...] = ()

    def to_json(self) -> dict[str, Any]:
        """What ``curves.js`` reads."""
        panels = [None if panel is None else panel_data(panel) for panel in self.panels]
        return {"panels": panels, "columns": self.columns, "keys": [list(key) for key in self.keys]}


def lines(x: Array, columns: Array, names: Sequence[str], colours: Sequence[str], **look: Any) -> tuple[Line, ...]:
    """A line for each column of (rows, k), all over the same x, thinned together."""
    over, values = thin(x, columns, POINTS)
    return tuple(
        Line(name, colour, over, values[:, k], **look)
        for k, (name, colour) in enumerate(zip(names, colours, strict=False))
    )


def panel_data(panel: Panel) -> dict[str, Any]:
    """A panel in JSON; what it does not use is left out."""
    shared: list[Array] = []
    found = []
    for line in panel.lines:
        place = next((n for n, x in enumerate(shared) if x is line.x), len(shared))
        if place == len(shared):
            shared.append(line.x)
        values = rough(line.y) if panel.scale else fine(line.y)
        entry = {"x": place, "y": values, "c": line.colour, "w": line.width, "l": line.look, "n": line.name}
        found.append({key: value for key, value in entry.items() if value != ""})
    bars = [[bar.name, bar.colour, [list(span) for span in bar.spans], bar.note] for bar in panel.bars]
    asked = {
        "title": panel.title,
        "lines": found,
        "x": [fine(x) for x in shared],
        "along": panel.along,
        "scale": panel.scale,
        "edges": [number for number in map(float, panel.edges) if math.isfinite(number)],
        "met": panel.met,
        "least": list(panel.least),
        "bars": bars,
        "ticks": rough(np.array(panel.ticks)),
    }
    return {key: value for key, value in asked.items() if value}


def rough(values: Array) -> list[float | None]:
    """Numbers with ``DIGITS`` significant digits; null for one that is not finite."""
    return [float(f"{value:.{DIGITS - 1}e}") if math.isfinite(value) else None for value in values.tolist()]


def fine(values: Array) -> Any:
    """Differences in whole steps of one size, ``{"q": step, "d": [...]}``: small once compressed; or ``rough``."""
    reach = float(np.ptp(values)) if values.size else 0.0
    if not math.isfinite(reach) or reach == 0:
        return rough(values)
    step = float(f"{reach / STEPS:.2e}")
    whole = np.round(values / step) if step > 0 else np.full(values.shape, np.inf)
    if not np.all(np.abs(whole) < 2**53):
        return rough(values)
    return {"q": step, "d": np.diff(whole, prepend=0.0).astype(np.int64).tolist()}
