"""Stages of smoothing: the table of a run's page, and what marks them in its figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from symphys.findings.writing import show
from symphys.report.figures import style
from symphys.report.pages import words
from symphys.report.pages.markup import Html, card, pill, table, tag
from symphys.results.result import StageRecord, smoothed
from symphys.results.run import Run
from symphys.trajectory import Array

NARROWEST = 0.09
"""A stage that takes less of the axis has no room for its name."""
HOW_READ = (
    "Each stage starts from the best point of the one before. “There” is at the stage's own smoothing, as the solver "
    "saw it; “exact” is the same point in the exact rollout, which alone counts. The last point is the result, unless "
    "an earlier one or the guess is worth more exactly."
)


def stage_card(run: Run) -> Html:
    """The stages in a table; nothing for a run without smoothing."""
    if not smoothed(run.stages):
        return Html("")
    kinds = [kind for kind in ("rollouts", "gradients", "jacobians", "hessians") if used(run.stages, kind)]
    checked = bool(run.checks)
    header = ["smoothing", "ended as", "objective there", "exact objective"]
    header += ["error / tolerance there", "exact error / tolerance", ""] if checked else []
    rows = [row(stage, kinds, checked) for stage in run.stages]
    layout = "ttnn" + "nnt" * checked + "n" * (len(kinds) + 1)
    content = table([*header, *kinds, "time"], rows, layout, "Stages of smoothing")
    return card("Stages of smoothing", content, remark(run), anchor="stages", note=HOW_READ)


def used(stages: Sequence[StageRecord], kind: str) -> bool:
    """Whether any stage did an evaluation of this kind."""
    return any(stage.counts.get(kind, 0) > 0 for stage in stages)


def row(stage: StageRecord, kinds: Sequence[str], checked: bool) -> list[Html | str]:
    """The cells of one stage."""
    cells: list[Html | str] = [f"{show(stage.smoothing)} m/s" if stage.smoothing else "0, exact"]
    cells += [words.ended(stage.status), show(stage.objective), tag("b", show(stage.exact_objective))]
    if checked:
        cells += [show(stage.worst), tag("b", show(stage.exact_worst))]
        cells.append(pill("good", "met") if stage.solved else pill("bad", "missed"))
    cells += [words.count(stage.counts.get(kind, math.nan)) for kind in kinds]
    return [*cells, words.seconds(stage.seconds)]


def remark(run: Run) -> Html:
    """Says so where an earlier stage came closer than the last; its point is the result then, unless means decided."""
    last, best = run.stages[-1], min(run.stages, key=rank)
    if run.status == "interrupted" or rank(best) >= rank(last):
        return Html("")
    text = f"The point of the stage at {show(best.smoothing)} m/s "
    if run.objective == best.exact_objective:
        text += "is the result: it does better in the exact rollout than that of the last stage"
    else:
        text += "does better in the exact rollout than the result"
    return tag("p", f"{text}: what the last stages gained, they gained for another problem.", class_="caption")


def rank(stage: StageRecord) -> tuple[bool, float]:
    """What comes closest in the exact rollout is lowest."""
    return not stage.solved, stage.exact_objective if math.isfinite(stage.exact_objective) else math.inf


def segments(run: Run) -> list[slice]:
    """The rows of the trace, cut where the smoothing changes."""
    smoothing = np.nan_to_num(run.trace["smoothing"])
    cuts = [0, *(np.flatnonzero(np.diff(smoothing)) + 1).tolist(), len(smoothing)]
    return [slice(first, last) for first, last in pairwise(cuts) if last > first]


def draw_bands(axes: Axes, run: Run, x: Array, named: bool) -> None:
    """A pale band behind every other stage; ``named`` writes the knob on those that have room."""
    parts = segments(run)
    edges = [x[0], *(0.5 * (x[part.start - 1] + x[part.start]) for part in parts[1:]), x[-1]]
    for index, (part, left, right) in enumerate(zip(parts, edges, edges[1:], strict=False)):
        if index % 2:
            axes.axvspan(left, right, color=style.GROUND, linewidth=0, alpha=0.7, zorder=0.2)
        if index:
            axes.axvline(left, color=style.FAINT, linewidth=0.8, zorder=0.4)
        if named and right - left >= NARROWEST * (x[-1] - x[0]):
            knob = run.trace["smoothing"][part.start]
            axes.annotate(
                f"smoothing {show(knob)}" if knob else "exact",
                (0.5 * (left + right), 1),
                xycoords=("data", "axes fraction"),
                xytext=(0, -3),
                textcoords="offset points",
                ha="center",
                va="top",
                color=style.SOFT,
                fontsize=7.5,
            )


def exact_ends(run: Run, x: Array, of: Callable[[StageRecord], float]) -> list[tuple[float, float, bool]]:
    """(x, exact number, whether met) at the end of each stage that the trace tells of."""
    ends = {run.trace["smoothing"][part.start]: x[part.stop - 1] for part in segments(run)}
    told = [(ends[s.smoothing], of(s), s.solved) for s in run.stages if s.smoothing in ends]
    return [end for end in told if math.isfinite(end[0]) and math.isfinite(end[1])]


def draw_exact(axes: Axes, ends: Sequence[tuple[float, float, bool]]) -> None:
    """A diamond at the exact number of each stage's end, hollow where it misses something."""
    axes.plot([x for x, _, _ in ends], [y for _, y, _ in ends], color=style.INK, linewidth=0.8, linestyle=(0, (1, 2)))
    for x, y, met in ends:
        face = style.INK if met else "white"
        axes.plot(x, y, "D", color=style.INK, markerfacecolor=face, markersize=5.5, zorder=4, clip_on=False)


def legend(colour: str) -> tuple[list[Line2D], list[str]]:
    """Handles and labels of a run's figure."""
    own = Line2D([], [], color=colour, linewidth=1.4)
    ends = [Line2D([], [], color=style.INK, marker="D", markersize=5.5, linestyle="none", markerfacecolor=face)
            for face in (style.INK, "white")]  # fmt: skip
    return [own, *ends], ["at the stage's own smoothing", "exact, at its end", "the same, something missed"]
