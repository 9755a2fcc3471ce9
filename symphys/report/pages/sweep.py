"""The part of a batch's page on a sweep: what was found, and whether it holds, against the keys that were swept.

Of one key there are curves, of two on a grid tables in colours, of more parallel coordinates and a panel for each key.
Points, cells and lines lead to the pages of their runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from symphys.findings import writing
from symphys.findings.writing import show
from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.report.charts.chart import Chart, Key, Line, Panel
from symphys.report.pages import words
from symphys.report.pages.answers import found_numbers
from symphys.report.pages.comparison import solve_time
from symphys.report.pages.markup import Html, banner, card, figures, tag
from symphys.report.pages.parallel import Course, Scale, parallel_coordinates
from symphys.results.discovery import Study, middle
from symphys.results.drawable import OVERSIZED, drawable, oversized
from symphys.results.run import Run
from symphys.types import Array

LEAST_STUDIES = 3
"""Settings of one problem that make a sweep, at least."""
MOST_RUNS, MOST_MEASURES, MOST_SIDE, MOST_NAMED = 600, 12, 30, 20
"""Runs and numbers that are drawn; values along a side of a table; runs that are named, at most."""
MOST_AXES = 9
"""Keys and numbers that have an axis each for three keys and more, at most."""
POINTS = "Filled: solved; hollow: not. A point leads to the page of its run."
SAME = 1e-9
"""Difference, as a share of the number and of 1, below which it counts as the same."""
WIDE = 100.0
"""Ratio of the largest to the smallest value of a key from which its axis is logarithmic."""


@dataclass(frozen=True)
class Measure:
    """A number of each run; ``met``: whether 1 and below is what was asked for."""

    title: str
    values: Array
    met: bool = False

    @property
    def varies(self) -> bool:
        """Whether it differs between runs by more than rounding."""
        known = self.values[np.isfinite(self.values)]
        return bool(np.ptp(known) > SAME * max(1.0, float(np.abs(known).max())))


@dataclass(frozen=True)
class SweptRuns:
    """Runs of one problem under settings of which some differ.

    Attributes:
        keys: the settings that differ.
        every: all of them.
        runs: those that are drawn.
        at: (runs, keys) the values of the keys.
        measures: what is drawn.
        same: numbers that are the same in all runs, in words.
        oversized: whether numbers are too large to be drawn.
    """

    keys: tuple[str, ...]
    every: tuple[Run, ...]
    runs: tuple[Run, ...]
    at: Array
    measures: tuple[Measure, ...]
    same: tuple[str, ...]
    oversized: bool


def sweep_of(found: Sequence[Study]) -> SweptRuns | None:
    """Return the sweep that all studies make together; None where they are of several problems, or not of numbers."""
    settings = [study.runs[0].settings for study in found]
    if len(found) < LEAST_STUDIES or len({study.problem for study in found}) > 1:
        return None
    keys = sorted({key for each in settings for key in each})
    keys = [key for key in keys if len({str(each.get(key)) for each in settings}) > 1]
    if not keys or any(type(each.get(key)) not in (int, float) for each in settings for key in keys):
        return None
    pairs = [(values, run) for values, study in zip(settings, found, strict=True) for run in study.runs]
    every = tuple(run for _, run in pairs)
    drawn = [pairs[k] for k in np.linspace(0, len(pairs) - 1, min(len(pairs), MOST_RUNS)).round().astype(int)]
    runs = tuple(run for _, run in drawn)
    at = np.array([[float(values[key]) for key in keys] for values, _ in drawn])
    whole = measures(runs)
    known = [replace(each, values=drawable(each.values)) for each in whole]
    known = [each for each in known if np.isfinite(each.values).any()]
    varied = [each for each in known if each.varies or each.met]
    same = tuple(map(constant_words, (each for each in known if not (each.varies or each.met))))
    too_large = any(oversized(each.values) for each in whole)
    return SweptRuns(tuple(keys), every, runs, at, tuple(varied[:MOST_MEASURES]), same, too_large)


def constant_words(measure: Measure) -> str:
    """Write a number that is the same in all runs, with its unit: ``throw.y 0 m/s``."""
    what, _, unit = measure.title.removesuffix("]").partition(" [")
    return f"{what} {show(float(measure.values[np.isfinite(measure.values)][0]))} {unit}".rstrip()


def measures(runs: Sequence[Run]) -> list[Measure]:
    """Return the numbers that the runs have: what was found, what is reported, how well, and in what time."""
    every = [found_numbers(run) for run in runs]
    names = dict.fromkeys(name for numbers in every for name in numbers)
    found = [Measure(name, np.array([numbers.get(name, math.nan) for numbers in every])) for name in names]
    outputs = dict.fromkeys(name for run in runs for name in run.outputs)
    found += [Measure(name, np.array([run.outputs.get(name, math.nan) for run in runs])) for name in outputs]
    of: tuple[tuple[str, Callable[[Run], float], bool], ...] = (
        ("objective", lambda run: run.objective, False),
        ("largest error / tolerance", lambda run: run.worst_ratio, True),
        ("time of the solve [s]", solve_time, False),
    )
    found += [Measure(title, np.array([read(run) for run in runs]), met) for title, read, met in of]
    return found


def sweep_parts(sweep: SweptRuns, links: Mapping[str, str]) -> list[Html]:
    """Return verdict, numbers against the keys, and the runs that are not solved; ``links``: pages by places."""
    named = writing.listed(sweep.keys)
    grid = [np.unique(sweep.at[:, k]) for k in range(len(sweep.keys))]
    if len(sweep.keys) == 2 and max(map(len, grid)) <= MOST_SIDE:
        tables = [heat_table(sweep, measure, grid, links) for measure in sweep.measures]
        framed = "Medians over solvers and seeds. " * (len(sweep.runs) > grid[0].size * grid[1].size)
        framed += "The larger, the darker; framed: not solved. A number leads to the page of its run."
        shown = [tag("div", *tables, class_="heats"), tag("p", framed, class_="caption")]
    elif len(sweep.keys) > 2:
        lines = "A line for each run, dashed where it is not solved; it leads to the run's page."
        shown = [courses(sweep, links), tag("p", lines, class_="caption"), figures([chart(sweep, links)], POINTS)]
    else:
        shown = [figures([chart(sweep, links)], POINTS)]
    if len(sweep.runs) < len(sweep.every):
        shown.append(tag("p", f"Drawn are {len(sweep.runs)} of {len(sweep.every)} runs, evenly.", class_="caption"))
    if sweep.oversized:
        shown.append(tag("p", OVERSIZED, class_="caption"))
    same = tag("p", f"The same in all runs: {writing.listed(sweep.same)}.", class_="caption") if sweep.same else ""
    return [verdict(sweep), card(f"Results against {named}", *shown, same, anchor="sweep"), unsolved(sweep, links)]


def courses(sweep: SweptRuns, links: Mapping[str, str]) -> Html:
    """Return every run as a line through its keys and its numbers."""
    scales = [Scale(key, sweep.at[:, k], across(sweep.at[:, k]) < 0) for k, key in enumerate(sweep.keys)]
    scales += [Scale(each.title, each.values, across(each.values) < 0) for each in sweep.measures]
    marks = palette.solver_marks(run.solver for run in sweep.runs)
    lines = [
        Course(marks[run.solver][0], links.get(run.place, ""), words.setting_title(run), not run.solved)
        for run in sweep.runs
    ]
    return parallel_coordinates(scales[:MOST_AXES], lines, f"All runs over {writing.listed(sweep.keys)}")


def verdict(sweep: SweptRuns) -> Html:
    """Return a banner: how many runs are solved, and from what to what each number goes."""
    solved = sum(run.solved for run in sweep.every)
    level = "good" if solved == len(sweep.every) else "fair" if solved else "bad"
    ranges = []
    for key, values in zip(sweep.keys, sweep.at.T, strict=True):
        different = writing.several(len(np.unique(values)), "value")
        ranges.append(f"{key} from {show(values.min())} to {show(values.max())} ({different})")
    return banner(level, f"{solved} of {writing.several(len(sweep.every), 'run')} solved", f"{'; '.join(ranges)}.")


def chart(sweep: SweptRuns, links: Mapping[str, str]) -> Chart:
    """Return a panel for each number and key; over a single key with lines through the medians."""
    solvers = list(dict.fromkeys(run.solver for run in sweep.runs))
    marks = palette.solver_marks(solvers)
    keys = tuple(Key(solver, marks[solver][0]) for solver in solvers)
    panels = []
    for measure in sweep.measures:
        for k, key in enumerate(sweep.keys):
            drawn = [
                line
                for solver in solvers
                for line in points(sweep, measure, k, solver, marks[solver][0], links, len(sweep.keys) == 1)
            ]
            scale = -1.0 if measure.met and np.nanmax(measure.values) > 0 else palette.scale_of(measure.values)
            panels.append(Panel(measure.title, tuple(drawn), key, scale, across(sweep.at[:, k]), met=measure.met))
    columns = min(len(sweep.keys), 3) if len(sweep.keys) > 1 else 2
    return Chart("sweep", f"Results against {writing.listed(sweep.keys)}", tuple(panels), columns, keys, height=2.2)


def points(
    sweep: SweptRuns, measure: Measure, k: int, solver: str, colour: str, links: Mapping[str, str], joined: bool
) -> list[Line]:
    """Return the runs of a solver as points, solved and unsolved ones apart, and a line through medians over seeds."""
    own = np.array([run.solver == solver for run in sweep.runs]) & np.isfinite(measure.values)
    x, y = sweep.at[:, k], measure.values
    found = []
    if joined and own.any():
        at = np.unique(x[own])
        found.append(Line(solver, colour, at, np.array([middle(y[own & (x == value)]) for value in at]), look="plain"))
    solved = np.array([run.solved for run in sweep.runs])
    for look, some in (("dots", own & solved), ("rings", own & ~solved)):
        if some.any():
            pages = tuple(links.get(sweep.runs[i].place, "") for i in np.flatnonzero(some))
            found.append(Line(solver, colour, x[some], y[some], look=look, links=pages))
    return found


def across(values: Array) -> float:
    """Return -1 for values that a logarithmic axis shows better, else 0."""
    return -1.0 if values.min() > 0 and values.max() >= WIDE * values.min() else 0.0


def heat_table(sweep: SweptRuns, measure: Measure, grid: Sequence[Array], links: Mapping[str, str]) -> Html:
    """Return a table over two keys: medians over runs, the larger the darker, linked to the first of the runs."""
    across_key, down_key = sweep.keys
    known = measure.values[np.isfinite(measure.values)]
    low, high = float(known.min()), float(known.max())
    head = [tag("th", f"{down_key} ↓, {across_key} →", scope="col")]
    head += [tag("th", show(value), scope="col", class_="number") for value in grid[0]]
    rows = []
    for down in grid[1]:
        cells = [tag("th", show(down), scope="row", class_="number")]
        for value in grid[0]:
            here = (sweep.at[:, 0] == value) & (sweep.at[:, 1] == down) & np.isfinite(measure.values)
            cells.append(heat_cell(sweep, measure, here, (low, high), links))
        rows.append(tag("tr", *cells))
    content = tag("table", tag("thead", tag("tr", *head)), tag("tbody", *rows), class_="heat", aria_label=measure.title)
    return tag("div", tag("h3", measure.title), tag("div", content, class_="scroll"))


def heat_cell(
    sweep: SweptRuns, measure: Measure, here: Array, ends: tuple[float, float], links: Mapping[str, str]
) -> Html:
    """Return the cell of the runs that are ``here``; framed where one of them is not solved."""
    which = np.flatnonzero(here)
    if not which.size:
        return tag("td", writing.DASH, class_="number")
    value = middle(measure.values[which].tolist())
    share = (value - ends[0]) / (ends[1] - ends[0]) if ends[1] > ends[0] else 0.0
    runs = [sweep.runs[i] for i in which]
    link = links.get(runs[0].place, "")
    text = tag("a", show(value), href=link) if link else show(value)
    missed = "" if all(run.solved for run in runs) else " missed"
    return tag("td", text, class_=f"number{missed}", style=f"--share:{100 * share:.0f}%")


def unsolved(sweep: SweptRuns, links: Mapping[str, str]) -> Html:
    """Name the runs that are not solved, with what they came to."""
    missed = [run for run in sweep.every if not run.solved]
    items = []
    for run in missed[:MOST_NAMED]:
        name = f"{run.place.rpartition('/')[0] or run.problem}, {run.solver}, seed {run.seed}"
        link = links.get(run.place, "")
        items.append(tag("li", tag("a", name, href=link) if link else name, f": {words.verdict(run)}"))
    more = f" The first {MOST_NAMED} of {len(missed)}." if len(missed) > MOST_NAMED else ""
    return card("Runs that are not solved", tag("ul", *items) if items else "", note=more.strip())
