"""A chart: panels of curves as numbers. A page draws it by ``charts.js``, a figure by ``charts.drawing``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.report.charts.tables import Table, thin
from symphys.types import Array

POINTS = 240
"""Largest number of samples of a line in a page, about: a panel is some 300 pixels wide."""
MARKS = 1500
"""Largest number of points of a cloud of them in a page: an even choice, which keeps how densely they lie."""
RESOLUTION = 4000
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
        look: words. "steps": a value holds until the next; "middles": until half way to the next; "dashed", "dotted",
            "pale" (translucent); "plain": without dots at few samples; "area": shaded down to 0. "points", "dots" and
            "rings" are marks alone: small, large, and hollow ones.
        mark: matplotlib's name of "dots" and "rings" in a figure.
        links: of "dots" and "rings": the page that each leads to; empty for none.
    """

    name: str
    colour: str
    x: Array
    y: Array
    width: float = 1.4
    look: str = ""
    mark: str = "D"
    links: tuple[str, ...] = ()

    def has(self, word: str) -> bool:
        """Whether ``look`` has this word."""
        return word in self.look.split()


@dataclass(frozen=True)
class Bars:
    """A row of bars: from when until when something holds; ``note`` stands at its end."""

    name: str
    colour: str
    spans: tuple[tuple[float, float], ...]
    note: str = ""


@dataclass(frozen=True)
class Panel:
    """A set of axes with lines or bars.

    Attributes:
        title: what it shows, with the unit.
        lines: in the order in which they are drawn.
        along: title of the horizontal axis.
        scale: 0 for linear, -1 for logarithmic, else linear up to this size and logarithmic beyond.
        across: -1 for a logarithmic horizontal axis.
        edges: heights of horizontal lines, such as bounds.
        beyond: (low, high) heights that are shaded, such as those past a limit; infinite at an open end.
        met: whether a value of 1 or below is met, which is marked.
        least: (low, high) that the vertical axis shows at least, or (low,); empty for what the lines need.
        bars: rows of bars in place of lines.
        ticks: marks along the bottom.
        stages: (from, to, text) along the horizontal axis: bands, and what stands above them.
        end: (x, text) of a vertical line; empty for none.
        note: stands beside the title.
    """

    title: str
    lines: tuple[Line, ...] = ()
    along: str = ""
    scale: float = 0.0
    across: float = 0.0
    edges: tuple[float, ...] = ()
    beyond: tuple[tuple[float, float], ...] = ()
    met: bool = False
    least: tuple[float, ...] = ()
    bars: tuple[Bars, ...] = ()
    ticks: tuple[float, ...] = ()
    stages: tuple[tuple[float, float, str], ...] = ()
    end: tuple[float, str] | tuple[()] = ()
    note: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the panel as ``charts.js`` reads it, without what it does not use."""
        drawn, shared = [], list[Array]()
        for group in by_abscissa(self.lines):
            x, columns = sampled(group)
            for line, y in zip(group, columns.T, strict=True):
                values = rounded(y) if self.scale else differences(y)
                entry = {"x": len(shared), "y": values, "w": line.width, "l": line.look, "links": list(line.links)}
                drawn.append({**entry, "n": line.name, "c": palette.on_page(line.colour)})
            shared.append(x)
        found = {
            "title": f"{self.title}, {self.note}" if self.note else self.title,
            "lines": [{key: value for key, value in line.items() if value not in ("", [])} for line in drawn],
            "x": [rounded(x) if self.across else differences(x) for x in shared],
            "along": self.along,
            "scale": self.scale,
            "across": self.across,
            "edges": [number for number in map(float, self.edges) if math.isfinite(number)],
            "beyond": [rounded(np.array(band)) for band in self.beyond],
            "met": self.met,
            "least": list(self.least),
            "bars": [
                [bar.name, palette.on_page(bar.colour), [list(span) for span in bar.spans], bar.note]
                for bar in self.bars
            ],
            "ticks": rounded(np.array(self.ticks)),
            "stages": [[*rounded(np.array(stage[:2])), stage[2]] for stage in self.stages],
            "end": list(self.end),
        }
        return {key: value for key, value in found.items() if value}


@dataclass(frozen=True)
class Key:
    """An entry of the legend; ``look`` and ``mark`` as of a ``Line``, or "shade" for an area; a line has no mark."""

    name: str
    colour: str
    look: str = ""
    mark: str = ""


@dataclass(frozen=True)
class Chart:
    """Panels side by side, row after row.

    Attributes:
        name: of the figure's files.
        alt: what it shows, for those who cannot see it.
        panels: None is an empty place.
        columns: panels in a row.
        keys: what the colours mean.
        tables: the numbers that it shows, for its CSV file.
        height: [in] of a row.
        widths: of the columns in a figure, relative; empty for equal ones.
        points: largest number of samples of a line in a figure, about.
    """

    name: str
    alt: str
    panels: tuple[Panel | None, ...]
    columns: int = 1
    keys: tuple[Key, ...] = ()
    tables: tuple[Table, ...] = ()
    height: float = 1.75
    widths: tuple[float, ...] = ()
    points: int = 700

    def to_json(self) -> dict[str, Any]:
        """Return the chart as ``charts.js`` reads it."""
        panels = [panel and panel.to_json() for panel in self.panels]
        keys = [[key.name, palette.on_page(key.colour), key.look] for key in self.keys]
        return {"panels": panels, "columns": self.columns, "keys": keys, "height": self.height}


def lines(x: Array, columns: Array, names: Sequence[str], colours: Sequence[str], **look: Any) -> tuple[Line, ...]:
    """Return a line for each column of (rows, k), all over the same x."""
    return tuple(
        Line(name, colour, x, columns[:, k], **look)
        for k, (name, colour) in enumerate(zip(names, colours, strict=False))
    )


def sampled(group: Sequence[Line]) -> tuple[Array, Array]:
    """Return (rows,) x and (rows, k) y of lines over one x, with as many samples as a page shows."""
    x, columns = group[0].x, np.stack([line.y for line in group], axis=1)
    if any(line.links for line in group):
        return x, columns
    if not any(line.has("points") for line in group):
        return thin(x, columns, POINTS)
    chosen = np.linspace(0, len(x) - 1, min(len(x), MARKS)).round().astype(int)
    return x[chosen], columns[chosen]


def by_abscissa(drawn: Sequence[Line]) -> Iterator[list[Line]]:
    """Yield neighbouring lines that share one x, which are thinned together."""
    group: list[Line] = []
    for line in drawn:
        if group and line.x is not group[0].x:
            yield group
            group = []
        group.append(line)
    if group:
        yield group


def rounded(values: Array) -> list[float | None]:
    """Return numbers with ``DIGITS`` significant digits; null for one that is not finite."""
    return [float(f"{value:.{DIGITS - 1}e}") if math.isfinite(value) else None for value in values.tolist()]


def differences(values: Array) -> Any:
    """Return ``{"q": step, "d": [...]}``, differences in whole steps, small once compressed; or ``rounded`` numbers."""
    span = float(np.ptp(values)) if values.size else 0.0
    if not math.isfinite(span) or span == 0:
        return rounded(values)
    step = float(f"{span / RESOLUTION:.2e}")
    whole = np.round(values / step) if step > 0 else np.full(values.shape, np.inf)
    if not np.all(np.abs(whole) < 2**53):
        return rounded(values)
    return {"q": step, "d": np.diff(whole, prepend=0.0).astype(np.int64).tolist()}
