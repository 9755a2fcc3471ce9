"""Stages of smoothing are shown with exact numbers, marked in figures, and never mixed with smoothed ones."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import few

from symphys.report import write_batch_report, write_run_report
from symphys.report.charts.convergence import Curve, best_so_far, curve, violation_so_far
from symphys.report.charts.run import convergence_chart, exact_ends, segments
from symphys.report.figures.drawing import draw_chart
from symphys.results.run import Run, read_run

Edit = Callable[..., None]
SMOOTHINGS = (0.1, 0.01, 0.0)
ENDS = (20, 30, 44)
"""The last row of each stage among the 45 of the fixture's trace."""


def stage(smoothing: float, objective: float, exact: float, solved: bool) -> dict[str, Any]:
    """One of "stages" in result.json."""
    counts = {"rollouts": 21, "gradients": 13, "jacobians": 0, "hessians": 0}
    exactly = {"exact_objective": exact, "exact_worst": 100 * exact, "solved": solved}
    told = {"smoothing": smoothing, "status": "stalled", "objective": objective, "worst": 0.5, "counts": counts}
    return {**told, **exactly, "equivalents": 61.0, "seconds": 0.25}


STAGES = [stage(0.1, 2e-5, 0.5, False), stage(0.01, 3e-5, 0.02, False), stage(0.0, 8e-4, 8e-4, True)]


@pytest.fixture
def staged(run_dir: Path, edit: Edit) -> Path:
    """The thrown ball, as if solved in three stages; without its motion, which takes long to draw."""
    for name in ("trajectory.npz", "guess.npz"):
        (run_dir / name).unlink()
    with (run_dir / "trace.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == ENDS[-1] + 1
    for index, row in enumerate(rows):
        row["smoothing"] = str(SMOOTHINGS[sum(index > end for end in ENDS)])
    with (run_dir / "trace.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    edit(run_dir / "result.json", stages=STAGES, guess={"objective": 7.0, "worst": 700.0})
    return run_dir


def text_of(page: Path) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", page.read_text(encoding="utf-8")))


def run_of(folder: Path) -> Run:
    return read_run(folder, folder)


def test_a_table_tells_what_each_stage_came_to(staged: Path) -> None:
    text = text_of(write_run_report(staged))
    assert "Stages of smoothing" in text
    first = "0.1 m/s no more progress 2 × 10⁻⁵ 0.5 0.5 50 ✕ missed 21 13 0.25 s"  # noqa: RUF001
    assert first in text
    assert "0, exact no more progress 8 × 10⁻⁴ 8 × 10⁻⁴ 0.5 0.08 ✓ met" in text  # noqa: RUF001
    assert "jacobians" not in text.partition("Stages of smoothing")[2].partition("Convergence")[0]


@pytest.mark.slow
def test_a_run_without_smoothing_has_no_such_table(run_dir: Path, edit: Edit) -> None:
    edit(run_dir / "result.json", stages=[STAGES[-1]])
    assert "Stages of smoothing" not in text_of(write_run_report(run_dir))


def test_one_stage_with_smoothing_is_told_too(staged: Path, edit: Edit) -> None:
    edit(staged / "result.json", stages=STAGES[:1])
    assert "Stages of smoothing" in text_of(write_run_report(staged))


@pytest.mark.slow
def test_an_earlier_stage_that_did_better_is_named(staged: Path, edit: Edit) -> None:
    assert "is better in the exact rollout" not in text_of(write_run_report(staged))
    better = [STAGES[0], stage(0.01, 1e-5, 1e-5, True), STAGES[2]]
    edit(staged / "result.json", stages=better)
    assert "The point of the stage at 0.01 m/s is better in the exact rollout" in text_of(write_run_report(staged))
    edit(staged / "result.json", stages=better, objective=1e-5)
    assert "The point of the stage at 0.01 m/s is the result: it is better in the exact rollout" in text_of(
        write_run_report(staged)
    )
    edit(staged / "result.json", stages=better, status="interrupted")
    assert "is better in the exact rollout" not in text_of(write_run_report(staged))


def test_without_checks_there_are_no_columns_of_errors(staged: Path, edit: Edit) -> None:
    edit(staged / "result.json", checks=[])
    part = text_of(write_run_report(staged)).partition("Stages of smoothing")[2]
    assert "tolerance" not in part.partition("Convergence")[0]


def test_only_exact_numbers_are_compared(staged: Path) -> None:
    """At the start, at the end of each stage, and along the exact one; the smoothed ones are far lower."""
    run = run_of(staged)
    exact = run.trace["best"][ENDS[1] + 1 :]
    expected = np.concatenate([np.full(20, 7.0), np.full(10, 0.5), [0.02], np.minimum(exact, 0.02)])
    np.testing.assert_allclose(best_so_far(run), expected)
    miss = np.fmin.accumulate(np.append(2.0, run.trace["max_violation"][ENDS[1] + 1 :]))
    np.testing.assert_allclose(violation_so_far(run), [*np.full(20, 700), *np.full(10, 50), *miss])


def test_a_curve_of_constant_smoothing_is_its_start_and_end(staged: Path, edit: Edit) -> None:
    edit(staged / "result.json", stages=[stage(0.1, 1e-9, 0.5, False)])
    run = run_of(staged)
    run.trace.columns["smoothing"][:] = 0.1  # type: ignore[index]
    found = curve(run, "equivalents", best_so_far)
    assert isinstance(found, Curve)
    assert set(found.y) == {7.0, 0.5} and found.y[-1] == 0.5


def test_boundaries_and_exact_ends_are_where_the_stages_change(staged: Path) -> None:
    run = run_of(staged)
    assert [part.stop - 1 for part in segments(run)] == list(ENDS)
    x = run.trace["equivalents"]
    ends = exact_ends(run, x, lambda each: each.exact_objective)
    assert ends == [(x[end], each["exact_objective"], each["solved"]) for end, each in zip(ENDS, STAGES, strict=True)]


@pytest.mark.slow
def test_the_figure_marks_them(staged: Path) -> None:
    run = run_of(staged)
    chart = convergence_chart(run)
    assert chart is not None
    objective, errors = draw_chart(chart).axes[:2]
    x = run.trace["equivalents"]
    borders = [line.get_xdata()[0] for line in objective.lines if line.get_color() == "#b4bec8"]
    assert borders == [(x[end] + x[end + 1]) / 2 for end in ENDS[:2]]
    for axes, name in ((objective, "exact_objective"), (errors, "exact_worst")):
        marks = [line for line in axes.lines if line.get_marker() == "D"]
        ends = [(x[end], each[name]) for end, each in zip(ENDS, STAGES, strict=True)]
        places = {line.get_markerfacecolor() == "white": [*map(tuple, line.get_xydata())] for line in marks}
        assert places == {True: ends[:2], False: ends[2:]}
    assert [text.get_text() for text in objective.texts] == ["smoothing 0.1", "smoothing 0.01", "exact"]


def test_a_stage_without_rows_has_its_place_in_the_table_only(staged: Path, edit: Edit) -> None:
    """One that could not be simulated."""
    broken = stage(0.05, 0.0, 0.5, False) | {"objective": "nan", "worst": "nan", "status": "not_finite"}
    edit(staged / "result.json", stages=[STAGES[0], broken, *STAGES[1:]])
    assert len(exact_ends(run_of(staged), run_of(staged).trace["seconds"], lambda each: each.exact_worst)) == 3
    assert "0.05 m/s not finite" in text_of(write_run_report(staged))


@few("stages", [None, 3, {}, ["x"], [{}], [{"smoothing": "much", "counts": 3}]], 2)
def test_damaged_stages_do_no_harm(staged: Path, edit: Edit, stages: Any) -> None:
    edit(staged / "result.json", stages=stages, guess=stages)
    assert "Solved" in text_of(write_run_report(staged))


@pytest.mark.slow
def test_the_page_of_a_batch_says_who_used_stages(batch: Path, edit: Edit) -> None:
    path = batch / "ball_throw" / "gradient-seed1" / "result.json"
    assert "stages of smoothing" not in text_of(write_batch_report(batch))
    edit(path, stages=STAGES, guess={"objective": 7.0, "worst": 700.0})
    text = text_of(write_batch_report(batch))
    assert "Solved in stages of smoothing, 0.1, 0.01 and 0 m/s: gradient." in text
    assert "only start and end are drawn" in text


@pytest.mark.slow
def test_a_page_of_stages_is_made_the_same_twice(staged: Path) -> None:
    pages = [write_run_report(staged).read_bytes() for _ in range(2)]
    assert pages[0] == pages[1]
    assert json.loads((staged / "result.json").read_text())["stages"] == STAGES
