"""The look of every figure: palette, fonts, axes. Figures are made by matplotlib's object interface, as SVG."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator, SymmetricalLogLocator

from symphys import files
from symphys.records import dataclass
from symphys.report.charts.palette import FAINT, GRID, INK, SOFT, number_label
from symphys.report.figures.data import DataFigure, table
from symphys.types import Array

WIDTH = 10.0
"""[in] of every figure"""

FONTS = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', 'Liberation Sans', Arial, sans-serif"

SETTINGS: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "text.parse_math": False,
    "text.color": INK,
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.7,
    "axes.labelcolor": SOFT,
    "axes.labelsize": 8.5,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.major.size": 0,
    "ytick.major.size": 0,
    "xtick.major.pad": 5,
    "ytick.major.pad": 5,
    "lines.linewidth": 1.5,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.8,
    "figure.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "symphys",
    "path.simplify": True,
    "figure.constrained_layout.h_pad": 0.06,
    "figure.constrained_layout.w_pad": 0.06,
}


RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE = 1e-9, 1e-50
"""Numbers on an axis count as equal where they differ by less than this share of their size, or by less than this."""


@dataclass(frozen=True)
class Picture:
    """A finished figure: ``name`` is the stem of its files, ``alt`` says what it shows, ``csv`` holds its numbers."""

    name: str
    alt: str
    svg: str
    csv: str


@contextmanager
def paper() -> Iterator[None]:
    """Yield the settings under which figures are made and saved; all others are matplotlib's defaults."""
    with warnings.catch_warnings(), matplotlib.rc_context():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(SETTINGS)
        yield


def picture(name: str, alt: str, figure: DataFigure | None) -> list[Picture]:
    """Return a figure as texts of SVG and CSV that depend on its content alone; nothing for no figure."""
    return [] if figure is None else [Picture(name, alt, svg_text(figure), table(figure))]


def svg_text(figure: Figure) -> str:
    """Return a figure as SVG text that depends on its content alone."""
    buffer = io.StringIO()
    # Figure.savefig gives the same, but lays the figure out and draws it a first time for nothing.
    canvas: Any = FigureCanvasSVG(figure)
    canvas.print_svg(buffer, metadata={"Date": None, "Creator": None})
    svg = re.sub(r"<!DOCTYPE[^>]*>\s*|<metadata>.*?</metadata>\s*", "", buffer.getvalue(), flags=re.DOTALL)
    svg = svg.replace("'DejaVu Sans'", FONTS).replace("font-weight: 700", "font-weight: 600")
    return re.sub(r" +\n|\n+", "\n", svg)


def use_numbers(axes: Axes) -> None:
    """Round tick labels without offsets on both axes."""
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(number_label))


def axis_of(axes: Axes, which: str) -> matplotlib.axis.Axis:
    """Return the x or y axis."""
    return axes.xaxis if which == "x" else axes.yaxis


def set_linear(axes: Axes, which: str, ticks: int = 5) -> None:
    """Set a linear axis with at most about ``ticks`` ticks, at round numbers."""
    axis = axis_of(axes, which)
    axis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 5, 10]))
    axis.set_major_formatter(FuncFormatter(number_label))


def set_log(axes: Axes, which: str, values: Array) -> None:
    """Set a logarithmic axis whose ticks suit the decades that it covers."""
    axes.set(**{f"{which}scale": "log"})
    axis = axis_of(axes, which)
    positive = values[values > 0]
    decades = np.log10(positive.max() / positive.min()) if positive.size else 1
    axis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0) if decades < 2.3 else (1.0,), numticks=9))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(number_label))


def set_symlog(axes: Axes, which: str, linear: float) -> None:
    """Set a symmetric logarithmic axis, linear up to a power of ten near ``linear``."""
    threshold = 10.0 ** np.ceil(np.log10(linear))
    transform = {"value": "symlog", "linthresh": threshold, "linscale": 0.5}
    (axes.set_xscale if which == "x" else axes.set_yscale)(**transform)
    axis = axis_of(axes, which)
    locator = SymmetricalLogLocator(base=10, linthresh=threshold)
    locator.set_params(numticks=7)
    axis.set_major_locator(locator)
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(number_label))


def apart(low: Array, high: Array) -> tuple[Array, Array]:
    """Return the corners (k,) of a box, or of a larger one about it where an axis would see only a point.

    That is where all sides are below ``RELATIVE_TOLERANCE`` of the coordinates. The larger box takes a fifth of these,
    or 1.
    """
    size = float(max(np.abs(low).max(), np.abs(high).max()))
    if float((high - low).max()) > max(RELATIVE_TOLERANCE * size, ABSOLUTE_TOLERANCE):
        return low, high
    middle, half = low + (high - low) / 2, 0.1 * size if size > ABSOLUTE_TOLERANCE else 0.5
    return middle - half, middle + half


def legend_above(figure: Figure, handles: Sequence[Artist], labels: Sequence[str]) -> None:
    """Draw one legend for all panels, in a row above them."""
    figure.legend(handles, labels, loc="outside upper left", ncols=min(len(labels), 8), borderaxespad=0.2)


def write_figures(folder: Path, pictures: Iterable[Picture]) -> list[Path]:
    """Write NAME.svg and NAME.csv of every picture into a folder; their paths. Raises FileError."""
    paths = []
    for picture in pictures:
        for kind, text in (("svg", picture.svg), ("csv", picture.csv)):
            paths.append(folder / f"{picture.name}.{kind}")
            files.write_text(paths[-1], text)
    return paths
