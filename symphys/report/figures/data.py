"""The numbers that a figure shows, and their table for other programs.

Every figure of a report is a ``DataFigure``. Where something is drawn, ``keep`` keeps its numbers, thinned where they
are drawn thinned; ``table`` makes the CSV file beside the SVG from them. A column belongs to the nearest column of
time, work or knots to its left, which lines over the same times share. Bounds, limits and instants are lists by
themselves. Below the end of what a column holds it is empty.
"""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symphys.types import Array

Column = Array | Sequence[str] | Sequence[float]
"""Numbers, or words."""
TIME = "time [s]"


class DataFigure(Figure):
    """A figure that keeps the numbers that it shows.

    Attributes:
        blocks: tables of columns by name, with the unit; the columns of one are equally long, its first one is what the
            others are over.
    """

    def __init__(self, **look: Any) -> None:
        """See matplotlib's Figure; nothing is kept yet."""
        super().__init__(**look)
        self.blocks: list[dict[str, list[Any]]] = []


def keep(axes: Axes, columns: Mapping[str, Column]) -> None:
    """Keep numbers that a panel shows; a figure of another kind keeps none.

    Args:
        axes: the panel.
        columns: by name, with the unit, ``"ball.position.x [m]"``; the first is what the others are over.
    """
    figure = axes.get_figure(root=True)
    if not isinstance(figure, DataFigure):
        return
    named = {name: plain(column) for name, column in columns.items()}
    over = next(iter(named))
    same = (block for block in figure.blocks if next(iter(block)) == over and block[over] == named[over])
    into = next(same, None)
    if into is None:
        figure.blocks.append(named)
        return
    for name, column in named.items():
        if into.get(name) != column:
            into[unused(name, into)] = column


def plain(column: Column) -> list[Any]:
    """Python's own numbers, or words."""
    words = isinstance(next(iter(column), None), str)
    return list(column) if words else np.asarray(column).tolist()


def vector(name: str, unit: str, values: Array, components: str = "xyz") -> dict[str, Array]:
    """The columns of (rows, k) values: ``ball.position.x [m]``, ..."""
    end = f" [{unit}]" if unit else ""
    return {f"{name}.{component}{end}": values[:, k] for k, component in enumerate(components)}


def table(figure: DataFigure) -> str:
    """The text of the CSV file: a header, then numbers in full precision, "nan" where one is not known."""
    names: dict[str, None] = {}
    for block in figure.blocks:
        for name in block:
            names[unused(name, names)] = None
    columns = [map(written, column) for block in figure.blocks for column in block.values()]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(map(printable, names))
    writer.writerows(itertools.zip_longest(*columns, fillvalue=""))
    return out.getvalue()


def unused(name: str, names: Mapping[str, Any]) -> str:
    """The name, with a number behind it where there is one such already."""
    count, found = 1, name
    while found in names:
        count += 1
        found = f"{name} ({count})"
    return found


def written(value: Any) -> str:
    """A number by the fewest digits that give it again, or a word."""
    return printable(value) if isinstance(value, str) else repr(int(value) if isinstance(value, bool) else value)


def printable(text: str) -> str:
    """The text in one line, without what a file of text cannot hold."""
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)
