"""Numbers far beyond any that can be drawn leave a page that says what it leaves out."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.page_scripts import charts
from tools.repeats import few

from symphys.report import write_batch_report, write_run_figures, write_run_report
from symphys.results.drawable import MAX_DRAWABLE, OVERSIZED, drawable, oversized
from symphys.results.run import read_run

HUGE = [1e155, 1e299, 1e307]
QUICK = [("least_squares-seed0", 1e307)]
RECORDED = ("objective", "best", "miss", "gradient_norm", "step")
NUMBERS = ("objective", "costs", "checks", "z", "trust", "guess", "stages")
MOVED = ("position", "velocity", "angular_velocity", "force", "contact_force", "contact_gap")


def times(value: Any, factor: float) -> Any:
    """Every number in a value of JSON that is not a count, made larger; beyond the largest double none is."""
    if isinstance(value, dict):
        return {key: entry if key == "shape" else times(entry, factor) for key, entry in value.items()}
    if isinstance(value, list):
        return [times(entry, factor) for entry in value]
    return float(np.clip(value * factor, -1.7e308, 1.7e308)) if type(value) is float else value


def enlarge(folder: Path, factor: float, motion: bool = True) -> None:
    """Everything that a run folder tells of its solution and of the way there."""
    result = json.loads((folder / "result.json").read_text())
    found = {key: times(result[key], factor) for key in NUMBERS if key in result}
    (folder / "result.json").write_text(json.dumps(result | found))
    with (folder / "trace.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row.update({key: str(times(float(row[key]), factor)) for key in RECORDED if row[key] != "nan"})
    with (folder / "trace.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    for name in ("trajectory.npz", "guess.npz"):
        with np.load(folder / name) as archive:
            arrays = dict(archive)
        with np.errstate(over="ignore"):
            larger = {key: np.clip(arrays[key] * factor, -1.7e308, 1.7e308) for key in MOVED if key in arrays}
        arrays |= larger if motion else {}
        np.savez_compressed(folder / name, **arrays)


def text_of(page: Path) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", page.read_text(encoding="utf-8")))


@few("motion", [True, False], 1)
@few("factor", HUGE, 1)
def test_the_page_of_such_a_run(run_dir: Path, factor: float, motion: bool) -> None:
    """It says what is not drawn, why there is no motion, and has its numbers in tables."""
    enlarge(run_dir, factor, motion)
    text = text_of(write_run_report(run_dir))
    assert OVERSIZED in text
    objective = json.loads((run_dir / "result.json").read_text())["objective"]
    power = int(np.floor(np.log10(objective)))
    assert any(f"10{sup(exponent)}" in text for exponent in (power, power + 1))
    assert ("trajectory.npz: position has numbers up to" in text) is motion
    assert ("cannot be drawn" in text) is motion


def sup(exponent: int) -> str:
    """An exponent as pages write it."""
    return str(exponent).translate(str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("which", "factor"),
    [
        pytest.param(which, factor, marks=() if (which, factor) in QUICK else pytest.mark.thorough)
        for which in ("gradient-seed2", "least_squares-seed0")
        for factor in HUGE
    ],
)
def test_the_batch_and_the_other_pages_are_those_without_it_but_for_a_note(
    batch: Path, which: str, factor: float
) -> None:
    """The pages of others to the last byte, the figures of the batch drawn."""
    other = batch / "ball_throw" / "gradient-seed1"
    before = write_run_report(other).read_bytes()
    assert OVERSIZED not in text_of(write_batch_report(batch))
    enlarge(batch / "ball_throw" / which, factor)
    page = write_batch_report(batch)
    assert OVERSIZED in text_of(page)
    assert charts(page.read_text("utf-8"))["ball_throw-convergence"]["panels"]
    assert write_run_report(other).read_bytes() == before


@pytest.mark.slow
def test_a_batch_of_nothing_else(batch: Path) -> None:
    for folder in (batch / "ball_throw").iterdir():
        if (folder / "trajectory.npz").exists():
            enlarge(folder, 1e200)
    text = text_of(write_batch_report(batch))
    assert OVERSIZED in text and "There is no motion to draw: trajectory.npz: position has numbers up to" in text


@pytest.mark.slow
def test_what_is_large_but_not_beyond_is_drawn(run_dir: Path) -> None:
    """No warning of an overflow either, which would be an error here."""
    enlarge(run_dir, 1e-3 * MAX_DRAWABLE)
    page = write_run_report(run_dir)
    assert "cannot be drawn" not in text_of(page)
    assert {"convergence", "states"} <= set(charts(page.read_text("utf-8")))
    assert {"convergence.svg", "motion.svg"} <= {path.name for path in write_run_figures(run_dir, run_dir / "figures")}


def test_only_numbers_that_are_finite_and_beyond_are_left_out(run_dir: Path) -> None:
    run = read_run(run_dir, run_dir)
    assert not oversized(run)
    same = drawable(run)
    np.testing.assert_array_equal(same.trace["objective"], run.trace["objective"])
    assert (same.objective, same.checks, same.status) == (run.objective, run.checks, run.status)
    assert drawable((1e51, -1e51, np.inf, 1e50))[2:] == (np.inf, 1e50)
    assert np.isnan(drawable((1e51, -1e51))).all()
