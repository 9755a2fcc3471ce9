"""Stages of smoothing: the table of a run's page."""

from __future__ import annotations

import math
from collections.abc import Sequence

from symphys.findings.writing import show
from symphys.report.pages import words
from symphys.report.pages.markup import Html, card, pill, table, tag
from symphys.results.result import StageRecord, smoothed
from symphys.results.run import Run

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
