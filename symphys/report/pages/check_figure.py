"""The errors of a batch against their tolerances as a picture: a row for each check, a lane for each solver."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from symphys.findings.writing import show
from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.report.pages.markup import Html, join, tag
from symphys.results.discovery import Study
from symphys.results.result import CheckRecord
from symphys.results.run import Run
from symphys.types import Array

MOST_CHECKS = 16
MOST_DOTS = 60
"""Seeds of a solver that are drawn as dots, at most."""
LOWEST, HIGHEST = 1e-3, 1e4
"""Ratios are drawn between these at most; beyond them stands an arrow."""
WIDTH, RIGHT, TOP, BOTTOM = 1000.0, 24.0, 6.0, 40.0
"""[px] Width of the picture, and its margins."""
LETTER, MOST_LETTERS = 6.6, 46
"""[px] Width of a letter, and letters of a name that are shown at most."""
LANE, LEAST_ROW = 13.0, 30.0
"""[px] Height of the lane of a solver, and of a row at least."""
RADIUS = 5.0
"""[px] Of the mark of a median."""
ROOM = 1.3
"""The axis goes on by this factor beyond the lowest and the highest ratio that is drawn."""
CORNERS = {
    "s": [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
    "D": [(0, -1.2), (1.2, 0), (0, 1.2), (-1.2, 0)],
    "^": [(0, -1.1), (1.1, 0.9), (-1.1, 0.9)],
    "v": [(0, 1.1), (1.1, -0.9), (-1.1, -0.9)],
    "<": [(-1.2, 0), (0.8, -1.1), (0.8, 1.1)],
    ">": [(1.2, 0), (-0.8, -1.1), (-0.8, 1.1)],
    "P": [(-0.4, -1.1), (0.4, -1.1), (0.4, -0.4), (1.1, -0.4), (1.1, 0.4), (0.4, 0.4), (0.4, 1.1), (-0.4, 1.1),
          (-0.4, 0.4), (-1.1, 0.4), (-1.1, -0.4), (-0.4, -0.4)],
    "X": [(-1.1, -0.6), (-0.6, -1.1), (0, -0.5), (0.6, -1.1), (1.1, -0.6), (0.5, 0), (1.1, 0.6), (0.6, 1.1), (0, 0.5),
          (-0.6, 1.1), (-1.1, 0.6), (-0.5, 0)],
}  # fmt: skip
"""Corners of a mark in units of its radius, by matplotlib's letter; one without corners is a circle."""

Numbers = dict[str, dict[str, Array]]
"""By check and solver, one for each run."""


@dataclass(frozen=True)
class Axis:
    """The logarithmic axis of ratios from ``low`` to ``high``, which begins at ``left`` [px]."""

    left: float
    low: float
    high: float

    def place(self, ratio: float) -> float:
        """Return the place [px] of a ratio, at an end for one beyond it."""
        low, high = self.low / ROOM, self.high * ROOM
        share = np.log10(np.clip(ratio, self.low, self.high) / low) / np.log10(high / low)
        return float(self.left + share * (WIDTH - RIGHT - self.left))

    def draw(self, height: float) -> Html:
        """Draw the axis, the part of it where a check is met, and the tolerance."""
        bottom, met = TOP + height, self.place(1.0) - self.left
        place = {"x": f"{self.left:g}", "y": f"{TOP:g}", "width": f"{met:.1f}", "height": f"{height:g}"}
        parts = [tag("rect", class_="met", **place)]
        for power in range(round(np.log10(self.low)), round(np.log10(self.high)) + 1):
            x, label = f"{self.place(10.0**power):.1f}", palette.number_label(10.0**power)
            parts.append(tag("path", d=f"M{x} {TOP:g}V{bottom:g}", class_="limit" if power == 0 else "grid"))
            parts.append(tag("text", label, x=x, y=f"{bottom + 15:g}", text_anchor="middle"))
        place = {"x": f"{WIDTH - RIGHT:g}", "y": f"{bottom + 32:g}", "text_anchor": "end"}
        return tag("g", *parts, tag("text", "error / tolerance, met at 1 or below", **place))


def by_check(study: Study, of: Callable[[Run, CheckRecord], float]) -> Numbers:
    """Return a number of each run and check by the check's name and the solver."""
    found: dict[str, dict[str, list[float]]] = {}
    for run in study.runs:
        for check in run.checks:
            found.setdefault(check.name, {}).setdefault(run.solver, []).append(of(run, check))
    return {name: {key: np.array(values) for key, values in solvers.items()} for name, solvers in found.items()}


def ratios(study: Study) -> Numbers:
    """Return error / tolerance by check and solver; nan counts as inf."""
    return by_check(study, lambda _, check: np.inf if np.isnan(check.ratio) else check.ratio)


def shown_checks(found: Numbers) -> list[str]:
    """Return the checks that get a row: all, or those with the largest medians, in the file's order."""
    worst = {name: max(float(np.median(seeds)) for seeds in solvers.values()) for name, solvers in found.items()}
    kept = set(sorted(worst, key=lambda name: -worst[name])[:MOST_CHECKS])
    return [name for name in found if name in kept]


def limits(found: Numbers) -> tuple[float, float]:
    """Return the range of the axis: whole decades around the ratios and 1."""
    every = np.concatenate([seeds for solvers in found.values() for seeds in solvers.values()])
    positive = every[np.isfinite(every) & (every > 0)]
    low = 10 ** np.floor(np.log10(min(positive.min(initial=1.0), 0.3)))
    high = 10 ** np.ceil(np.log10(max(positive.max(initial=1.0), 3.0)))
    return float(np.clip(low, LOWEST, 0.1)), float(np.clip(high, 10.0, HIGHEST))


def check_figure(study: Study) -> Html:
    """Draw dots for seeds and a mark for their median, hollow where it misses; empty without a check.

    The part of the logarithmic axis where a check is met is shaded. The title of each mark says its numbers.
    """
    found = ratios(study)
    if not found:
        return Html("")
    names, seeds = shown_checks(found), by_check(study, lambda run, _: run.seed)
    marks = palette.solver_marks(entry.solver for entry in study.entries)
    row = max(LANE * len(marks) + 16, LEAST_ROW)
    longest = min(max(map(len, names)), MOST_LETTERS)
    axis = Axis(24 + LETTER * longest, *limits(found))
    parts = [axis.draw(row * len(names))]
    for place, name in enumerate(names):
        middle = TOP + row * (place + 0.5)
        parts.append(row_name(name, axis, middle, row, bool(place)))
        for order, solver in enumerate(marks):
            if solver in found[name]:
                height = middle + (order - (len(marks) - 1) / 2) * LANE
                parts.append(lane(solver, marks[solver], height, found[name][solver], seeds[name][solver], axis))
    size = f"0 0 {WIDTH:g} {TOP + row * len(names) + BOTTOM:g}"
    svg = tag("svg", *parts, viewBox=size, role="img", aria_label="Errors against tolerances")
    keys = [tag("span", key(mark), palette.short(solver, 20)) for solver, mark in marks.items()]
    return tag("figure", tag("div", *keys, class_="legend"), tag("div", svg, class_="scroll"), class_="checks")


def key(mark: tuple[str, str]) -> Html:
    """Return the mark of a solver for the legend."""
    size = RADIUS * 1.4
    return tag("svg", glyph(*mark, 0, 0, True), viewBox=f"{-size:g} {-size:g} {2 * size:g} {2 * size:g}")


def row_name(name: str, axis: Axis, middle: float, row: float, bordered: bool) -> Html:
    """Write the name of a check, below a line from the row above."""
    border = tag("path", d=f"M{axis.left:g} {middle - row / 2:g}H{WIDTH - RIGHT:g}", class_="grid") if bordered else ""
    place = {"x": f"{axis.left - 12:g}", "y": f"{middle + 4:g}", "text_anchor": "end", "class_": "name"}
    return join([border, tag("text", palette.short(name, MOST_LETTERS), tag("title", name), **place)])


def lane(solver: str, mark: tuple[str, str], height: float, seen: Array, seeds: Array, axis: Axis) -> Html:
    """Draw the runs of one solver in one check."""
    colour, letter = mark
    middle, parts = float(np.median(seen)), list[Html]()
    if seen.size > 1:
        left, right = (axis.place(float(each)) for each in (seen.min(), seen.max()))
        parts.append(tag("path", d=f"M{left:.1f} {height:g}H{right:.1f}", class_="range"))
        for k in np.linspace(0, seen.size - 1, min(seen.size, MOST_DOTS)).round().astype(int):
            said = tag("title", f"{solver}, seed {seeds[k]:g}: {show(float(seen[k]), 3)}")
            parts.append(
                tag("circle", said, cx=f"{axis.place(float(seen[k])):.1f}", cy=f"{height:g}", r="2.5", class_="seed")
            )
    letter = "<" if middle < axis.low else ">" if middle > axis.high else letter
    many = f", median of {seen.size} seeds" if seen.size > 1 else ""
    said = tag("title", f"{solver}{many}: {show(middle, 3)} of the tolerance")
    parts.append(tag("g", said, glyph(colour, letter, axis.place(middle), height, middle <= 1)))
    return tag("g", *parts, stroke=colour, fill=colour)


def glyph(colour: str, letter: str, x: float, y: float, filled: bool) -> Html:
    """Draw the mark of a solver, hollow unless ``filled``."""
    look = {"fill": colour if filled else "#fff", "stroke": colour, "stroke_width": "1.5"}
    if letter not in CORNERS:
        return tag("circle", cx=f"{x:.1f}", cy=f"{y:g}", r=f"{RADIUS:g}", **look)
    corners = "L".join(f"{x + RADIUS * a:.1f} {y + RADIUS * b:.1f}" for a, b in CORNERS[letter])
    return tag("path", d=f"M{corners}Z", **look)
