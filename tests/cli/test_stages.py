"""Stages of smoothing set on the command line are solved one after the other, each judged exactly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from symphys.cli.wording import at
from symphys.results.config import case_name
from symphys.runs import read_result
from symphys.solvers import TraceRow

FOLDER = Path("reports", case_name("throw", {"simulation.smoothing": [0.1, 0.01, 0]}), "least_squares-seed0")

Run = Callable[..., tuple[int, str, str]]


@pytest.mark.slow
@pytest.mark.usefixtures("whole_report")
def test_a_setting_makes_stages(run: Run, throw: Path) -> None:
    code, _, _ = run("solve", throw, "--solver", "least_squares", "--set", "simulation.smoothing=[0.1, 0.01, 0]")
    found = read_result(FOLDER / "result.json")
    assert code == 0
    assert [(stage.smoothing, stage.solved) for stage in found.stages] == [(0.1, True), (0.01, True), (0.0, True)]
    assert "Stages of smoothing" in (FOLDER / "report.html").read_text(encoding="utf-8")


def test_a_setting_that_cannot_be(run: Run, throw: Path) -> None:
    code, _, err = run("solve", throw, "--set", "simulation.smoothing=[0, 0.1]")
    assert code == 2
    assert "throw.toml" in err and "simulation.smoothing: stages must decrease, as in [0.1, 0.01, 0]" in err


def test_progress_names_the_smoothing_where_numbers_are_not_exact() -> None:
    row = TraceRow(7, 8, 8, 0, 0, 0.1, 2.0, 1.5, 3.0, 0.1, 0.1, 0.03)
    assert at(row) == "iteration 7, objective 1.5 (now 2), worst 3 at smoothing 0.03"
    assert at(replace(row, smoothing=0.0)) == "iteration 7, objective 1.5 (now 2), worst 3"
