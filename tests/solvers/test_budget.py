"""How much of its budget a solve has used: the bound that comes first counts, and the time left is an upper bound."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from symphys.solvers import SOLVERS, CmaOptions, GradientOptions, TraceRow
from symphys.solvers.core.budget import BudgetUse

ROW = TraceRow(0, 1, 0, 0, 0, 0.0, 1.0, 1.0, 2.0, math.nan, math.nan, 0.0)


def used(options: object, *rows: TraceRow, smoothing: tuple[float, ...] = (0.0,)) -> BudgetUse:
    use = BudgetUse(options, smoothing)
    for row in rows:
        use.add(row)
    return use


def test_iterations_are_a_share_of_those_at_most() -> None:
    options = GradientOptions(iterations=100)
    assert used(options).share == 0 and used(options).seconds_left == math.inf
    use = used(options, ROW, replace(ROW, iteration=25, seconds=5.0))
    assert (use.share, use.seconds_left) == (0.25, 15.0)
    assert used(options, ROW, replace(ROW, iteration=101, seconds=5.0)).share == 1.0


def test_evaluations_are_counted_in_rollouts_from_the_first_generation_on() -> None:
    first, second = replace(ROW, rollouts=100, seconds=1.0), replace(ROW, iteration=1, rollouts=200, seconds=3.0)
    use = used(CmaOptions(evaluations=1000), first, second)
    assert (use.share, use.seconds_left) == (0.2, 16.0)


def test_every_stage_of_smoothing_has_the_whole_budget() -> None:
    """The first stage ends early, after 4 of 10 iterations: its share is done, its time is not saved up."""
    rows = [replace(ROW, iteration=k, seconds=float(k), smoothing=0.1) for k in range(5)]
    rows.append(replace(ROW, iteration=5, seconds=5.0))
    use = used(GradientOptions(iterations=10), *rows, smoothing=(0.1, 0.0))
    assert (use.share, use.seconds_left) == (0.5, 10.0)
    use.add(replace(ROW, iteration=10, seconds=10.0))
    assert (use.share, use.seconds_left) == (0.75, 5.0)


def test_the_bound_that_comes_first_counts() -> None:
    options = GradientOptions(iterations=100, max_seconds=20)
    use = used(options, ROW, replace(ROW, iteration=10, seconds=10.0))
    assert (use.share, use.seconds_left) == (0.5, 10.0)
    assert used(options).seconds_left == 20


@pytest.mark.parametrize("name", SOLVERS)
def test_every_solver_has_a_budget(name: str) -> None:
    """Of a race only the rounds are known, of which rows say nothing."""
    share = BudgetUse(SOLVERS[name].Options(), (0.0,)).share
    assert share == pytest.approx(math.nan if name == "race" else 0.0, nan_ok=True)


def test_nothing_is_said_of_what_nothing_bounds() -> None:
    use = used(object(), ROW, replace(ROW, iteration=10, seconds=10.0))
    assert math.isnan(use.share) and use.seconds_left == math.inf


def test_a_solve_that_goes_on_counts_its_pace_from_there() -> None:
    rows = [replace(ROW, iteration=k, seconds=60.0 + k, rollouts=k) for k in (50, 60)]
    assert used(GradientOptions(iterations=100), *rows).seconds_left == pytest.approx(90.0)
