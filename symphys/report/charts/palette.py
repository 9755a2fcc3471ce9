"""Colours, marks and labels that pages and figures share."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from symphys.findings import writing
from symphys.types import Array

INK, SOFT, FAINT, GRID = "#1f2d3a", "#5c6b78", "#b4bec8", "#e6ebef"
GROUND, GROUND_EDGE = "#eceff2", "#8795a3"
MET, BEYOND = "#e9f5f0", "#e9edf0"
"""Where a check is met, and what lies past a limit."""

# Okabe and Ito, Color Universal Design (2008); its yellow is too light for lines on white.
BLUE, VERMILION, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#cc79a7"
ORANGE, SKY, GREY = "#e69f00", "#56b4e9", "#4d4d4d"
CYCLE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, GREY)
AXES = (VERMILION, GREEN, BLUE)
"""x, y, z"""
AXIS_WIDTHS = (2.4, 1.6, 1.0)
"""Thinner and thinner, so that lines that lie on each other are all seen."""

BODIES = ("#34506b", ORANGE, SKY, "#8a6fae", GREEN, VERMILION, "#7a7f85")
"""Unlike the solvers' first colours, so that no body is taken for a solver."""

KNOWN_SOLVERS = {
    "gradient": (BLUE, "o"),
    "least_squares": (VERMILION, "s"),
    "ipopt": (GREEN, "^"),
    "cma": (PURPLE, "D"),
}
OTHER_SOLVERS = ((ORANGE, "v"), (SKY, "P"), (GREY, "X"), (BLUE, "X"), (VERMILION, "v"), (GREEN, "P"))


def solver_marks(solvers: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Colour and marker of each solver: the same on every page for those that are known."""
    names = sorted(set(solvers))
    others = [name for name in names if name not in KNOWN_SOLVERS]
    spare = {name: OTHER_SOLVERS[i % len(OTHER_SOLVERS)] for i, name in enumerate(others)}
    return {name: KNOWN_SOLVERS.get(name) or spare[name] for name in names}


THEMED = {INK: "var(--ink)", BODIES[0]: "var(--accent)", GREY: "var(--grey)"}
"""Colours that would not be seen on a dark page, as its style sheet names them."""


def on_page(colour: str) -> str:
    """Return a colour as pages write it."""
    return THEMED.get(colour, colour)


def short(text: str, length: int = 38) -> str:
    """Return a name cut to what a figure has room for."""
    return text if len(text) <= length else text[: length - 1] + "\N{HORIZONTAL ELLIPSIS}"


def number_label(value: float, _position: int = 0) -> str:
    """Return a tick's label: powers of ten only where they are shorter."""
    return writing.show(value, 4).replace("1 × 10", "10") if value else "0"  # noqa: RUF001


def scale_of(values: Array) -> float:
    """0 for a linear axis, -1 for a logarithmic one, else the size up to which a symmetric-logarithmic one is linear.

    Linear where the numbers are of one size, logarithmic where not, symmetric-logarithmic where some are <= 0.
    """
    known = values[np.isfinite(values)]
    sizes = np.abs(known[known != 0])
    if sizes.size == 0 or sizes.max() < 30 * sizes.min():
        return 0.0
    return -1.0 if (known > 0).all() else float(max(np.quantile(sizes, 0.1), sizes.max() * 1e-6))
