"""Parallel coordinates: an upright axis for each number, and a line through all of them for each run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.findings.writing import show
from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.report.pages.markup import Html, tag
from symphys.types import Array

WIDTH, HEIGHT, TOP, BOTTOM, SIDE = 1000.0, 330.0, 70.0, 24.0, 90.0
"""[px] Size of the picture and its margins."""
LETTERS = 240
"""Letters that the titles of all axes have room for; every other one stands higher."""


@dataclass(frozen=True)
class Scale:
    """An axis: its title, a number for each run, and whether it is logarithmic."""

    title: str
    values: Array
    logarithmic: bool = False

    def heights(self) -> Array:
        """Return the heights of all numbers [px]; nan for those that it cannot show."""
        values = np.log10(np.where(self.values > 0, self.values, np.nan)) if self.logarithmic else self.values
        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
        share = (values - low) / (high - low) if high > low else np.where(np.isfinite(values), 0.5, np.nan)
        return HEIGHT - BOTTOM - share * (HEIGHT - BOTTOM - TOP)


@dataclass(frozen=True)
class Course:
    """A run's line: its colour, where it leads to, what it is called, and whether it is dashed."""

    colour: str
    link: str
    title: str
    dashed: bool


def parallel_coordinates(scales: Sequence[Scale], courses: Sequence[Course], label: str) -> Html:
    """Return the picture; a line has gaps where its run lacks a number."""
    places = np.linspace(SIDE, WIDTH - SIDE, len(scales))
    heights = np.stack([scale.heights() for scale in scales], axis=1)
    lines = [line(places, each, course) for each, course in zip(heights, courses, strict=True)]
    letters = LETTERS // len(scales)
    axes = [axis(x, scale, letters, 15.0 * (k % 2)) for k, (x, scale) in enumerate(zip(places, scales, strict=True))]
    box = f"0 0 {WIDTH:.0f} {HEIGHT:.0f}"
    content = tag("svg", *axes, *lines, viewBox=box, role="img", aria_label=label)
    return tag("div", tag("div", content, class_="scroll"), class_="parallel")


def axis(x: float, scale: Scale, letters: int, raised: float) -> Html:
    """Return an axis with its ends and its title, of so many letters at most, which may be ``raised`` [px]."""
    known = scale.values[np.isfinite(scale.values)]
    ends = (float(known.min()), float(known.max())) if known.size else ()
    texts = [(TOP - 28 - raised, palette.short(scale.title, letters), "name")]
    texts += [(y, show(value, 3), "") for y, value in zip((HEIGHT - 6, TOP - 7), ends, strict=False)]
    return tag(
        "g",
        tag("path", d=f"M{x:.1f} {TOP:.0f}V{HEIGHT - BOTTOM:.0f}", class_="edge"),
        *(
            tag("text", text, x=f"{x:.1f}", y=f"{y:.0f}", text_anchor="middle", class_=kind or None)
            for y, text, kind in texts
        ),
        tag("title", scale.title),
    )


def line(places: Array, heights: Array, course: Course) -> Html:
    """Return a run's line, which leads to its page where it has one."""
    parts, broken = list[str](), True
    for x, y in zip(places, heights, strict=True):
        if np.isfinite(y):
            parts.append(f"{'M' if broken else 'L'}{x:.1f} {y:.1f}")
        broken = not np.isfinite(y)
    dashes = "4 3" if course.dashed else None
    path = tag("path", d="".join(parts), stroke=palette.on_page(course.colour), stroke_dasharray=dashes)
    titled = [tag("title", course.title), path]
    return tag("a", *titled, href=course.link) if course.link else tag("g", *titled)
