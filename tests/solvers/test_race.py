"""The race: a search sees where a gradient says nothing, a finisher converges, and both are parts of one solve."""

from __future__ import annotations

from dataclasses import astuple, replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from worlds import staged_toys
from worlds.staged_toys import boxed, pendulum
from worlds.toys import constrained, counted, failing, quadratic, rosenbrock, solve, stop_at, target, through_json, toy

from symphys.errors import SymphysError
from symphys.shooting import ShootingProblem
from symphys.solvers import Counts, Outcome, Status, TraceRow
from symphys.solvers.core.convergence import PLATEAU_ADVICE
from symphys.solvers.core.subspace import search_space
from symphys.solvers.methods import race
from symphys.solvers.methods.race import (
    CLOSE,
    FAR,
    FINISH,
    PATIENCE,
    POLISH,
    UNCHECKED,
    WithFinerSteps,
    distance,
)

SMALL = {"generations": 3, "population": 8, "rounds": 4}


def mesa(**more: Any) -> ShootingProblem:
    """Level at 2 around the guess 0; further out a bowl with its bottom at (1, 0)."""

    def miss(z: Any, s: Any) -> Any:
        return ca.if_else(ca.sumsqr(z) < 0.25, ca.vertcat(2, 0), z - ca.vertcat(1, 0))

    return toy(2, miss, errors=lambda z, s: ca.norm_2(miss(z, s)) / 1e-6, **more)


def level(**more: Any) -> ShootingProblem:
    """The same everywhere."""
    return toy(2, lambda z, s: 2 + 0 * z, errors=lambda z, s: 5 + 0 * z[0], **more)


def same(a: Outcome, b: Outcome) -> None:
    """All but the seconds."""
    assert (a.status, a.advice, a.counts) == (b.status, b.advice, b.counts)
    assert np.array_equal(a.z, b.z)
    rows = [[astuple(replace(row, seconds=0.0))[:-1] for row in outcome.trace] for outcome in (a, b)]
    np.testing.assert_array_equal(*rows)
    assert [repr(replace(each, seconds=0.0)) for each in a.stages] == [
        repr(replace(each, seconds=0.0)) for each in b.stages
    ]


def test_where_the_gradient_says_nothing_the_search_leads_and_the_finisher_ends() -> None:
    """To six digits, which a search of so few generations does not reach, and descent does not begin."""
    assert solve("least_squares", mesa()).advice == PLATEAU_ADVICE
    found = solve("race", mesa(), options=SMALL)
    assert found.status is Status.MET
    assert found.counts.jacobians > 0 and found.counts.rollouts > 8
    assert found.z == pytest.approx([1, 0], abs=1e-6)


@pytest.mark.parametrize("problem", [quadratic(), rosenbrock()], ids=["quadratic", "valley"])
def test_without_anything_to_meet_it_ends_as_its_finisher_does(problem: ShootingProblem) -> None:
    found, alone = (solve(name, problem) for name in ("race", "least_squares"))
    assert found.status is alone.status is Status.CONVERGED
    assert found.z == pytest.approx(alone.z, abs=1e-4)


def test_a_limit_is_met_where_its_penalty_alone_is_not_enough() -> None:
    """Penalty solvers end beyond the limit; the race keeps a point that meets it and costs little more than 2."""
    found, alone = (solve(name, constrained()) for name in ("race", "least_squares"))
    assert alone.status is Status.CONVERGED and alone.z.sum() > 1.005
    assert found.z.sum() == pytest.approx(1, abs=1e-3)
    assert np.sum((found.z - [2, 1]) ** 2) == pytest.approx(2, rel=2e-2)


def test_controls_over_time_are_finished_by_ilqr() -> None:
    problem = replace(boxed(pendulum(), 8.0), stop_when_met=False)
    found, alone = solve("race", problem, options={"rounds": 1}), solve("ilqr", problem)
    assert found.status is Status.CONVERGED
    assert found.gains
    assert found.stages[-1].objective <= alone.stages[-1].objective * (1 + 1e-6)


def test_a_guess_that_is_good_enough_for_ilqr_is_tried_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a search is far, and only as long as that comes near."""
    monkeypatch.setattr(staged_toys, "TOLERANCE", 1e-3)
    tiny = {"generations": 1, "population": 4, "sigma": 0.01, "rounds": 4}
    problem, words, given_up = replace(boxed(pendulum(), 100.0), stop_when_met=True), list[str](), list[str]()
    found = solve("race", problem, options=tiny, log=words.append)
    assert found.status is Status.MET and [word for word in words if ", part" in word] == [
        "search, part 1 of the race",
        "asked, part 2 of the race",
    ]
    monkeypatch.setattr(race, "HALF", 0.0)
    short = {**tiny, "finisher_iterations": 2}
    whole = solve("race", problem, options=short, log=given_up.append)
    kinds = [word.split(",")[0] for word in given_up if ", part" in word]
    assert kinds[:4] == ["search", "asked", "own", "finish"] and kinds.count("asked") == kinds.count("own") == 1
    for stop in range(6):  # also where the try ends; ilqr rolls out once more where it goes on
        saved = list[dict[str, Any]]()
        keep = partial(lambda saved, make: saved.append(through_json(make())), saved)
        part = solve("race", problem, options=short, monitor=stop_at(stop), keep=keep)
        for checkpoint in (through_json(part.checkpoint), *saved[-1:]):  # interrupted, or killed
            again = solve("race", problem, options=short, checkpoint=checkpoint)
            assert np.array_equal(again.z, whole.z) and len(again.trace) == len(whole.trace)


def test_met_at_the_start() -> None:
    found = solve("race", replace(target(), blocks=(replace(target().blocks[0], guess=np.array([2.0, -1.0])),)))
    assert (found.status, len(found.trace)) == (Status.MET, 1)


def test_what_does_not_hold_with_finer_steps_does_not_end_it() -> None:
    """Two points meet everything, one of them only as it stands."""

    def miss(z: Any, s: Any) -> Any:
        return (z - 1) * (z + 1)

    problem = toy(1, miss, errors=lambda z, s: ca.fabs(miss(z, s)) / 1e-3, guess=0.9, bounds=(-3.0, 3.0))
    asked = []

    def confirms(z: Any) -> bool:
        asked.append(float(z[0]))
        return bool(z[0] < 0)

    found = solve("race", replace(problem, confirms=confirms), options={**SMALL, "rounds": 20})
    assert (found.status, found.z[0]) == (Status.MET, pytest.approx(-1, abs=1e-3))
    assert any(each > 0 for each in asked)
    never = solve("race", replace(problem, confirms=lambda z: False), options=SMALL)
    assert never.status is Status.MET


def test_a_search_counts_as_met_what_is_met_with_finer_steps_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """The best few of those that are close are tried; of others nobody knows."""
    monkeypatch.setattr(race, "CHECKED", 4)
    problem = toy(1, lambda z, s: z, errors=lambda z, s: ca.fabs(z))
    asked = list[float]()

    def finer(Z: Any) -> Any:
        asked.extend(Z[:, 0].tolist())
        return np.where(Z < 0.2, 3.0, np.where(Z < 0.3, np.nan, 0.4))

    checked = WithFinerSteps(problem, finer, lambda objectives, errors: objectives)
    Z = np.array([[0.9], [0.1], [1.5], [0.2], [0.5], [0.4], [CLOSE + 0.1]])
    errors = checked.value(Z, 0.0).errors[:, 0]
    assert asked == [0.1, 0.2, 0.4, 0.5]
    assert errors.tolist() == [UNCHECKED, 3.0, 1.5, FAR, 0.5, 0.4, CLOSE + 0.1]
    asked.clear()
    checked.value(Z[2:3], 0.0)
    assert asked == [1.5]
    assert checked.value(Z, 0.1).errors[:, 0].tolist() == pytest.approx(np.abs(Z[:, 0]))
    found = solve("race", replace(mesa(), finer_errors=lambda Z: np.zeros((len(Z), 1))), options=SMALL)
    same(found, solve("race", mesa(), options=SMALL))


def test_costs_do_not_keep_it_from_what_is_asked_for() -> None:
    """Distances fall with what is missing, whatever it costs; of what misses nothing, with the costs."""
    errors = np.array([[5.0, 0.0], [2.0, 0.4], [0.5, 0.1], [0.2, 0.2]])
    costs = np.array([-1e9, 1e3, 5.0, 2.0])
    found = distance(costs, errors, 4.0)
    assert (np.diff(found) < 0).all()
    assert found[2:] == pytest.approx(np.exp([5 / 18, 2 / 12]))
    assert np.array_equal(distance(costs, errors[:, :0], 4.0), costs)
    assert np.isnan(distance(costs[:1], np.array([[np.nan, 0.0]]), 4.0)).all()


def test_hops_leave_points_where_descent_ends() -> None:
    """A slope with many valleys; an interrupted race goes on to the last bit, also within a hop."""

    def miss(z: Any, s: Any) -> Any:
        return 1.5 + z[0] + 2 * z[1] ** 2 + 0.8 * ca.sin(9 * z[0]) * ca.cos(7 * z[1])

    problem = toy(2, miss, errors=lambda z, s: ca.fabs(miss(z, s)) / 1e-3, guess=2.0, bounds=(-3.0, 3.0))
    words = list[str]()
    options = {"generations": 1, "population": 3, "sigma": 0.2, "rounds": 4}
    alone = solve("least_squares", problem)
    assert alone.status is Status.CONVERGED and abs(miss(alone.z, 0.0)) > 1
    found = solve("race", problem, options=options, log=words.append)
    assert found.status is Status.MET
    assert next(word.split(":")[0] for word in words if ": met" in word) in race.HOPS
    for stop in range(len(found.trace)):
        part = solve("race", problem, options=options, monitor=stop_at(stop))
        same(solve("race", problem, options=options, checkpoint=through_json(part.checkpoint)), found)


def test_what_keeps_costs_low_and_misses_is_left() -> None:
    """Gauss-Newton ends where costs and target are in balance; the race where the target is met."""

    def residuals(z: Any, s: Any) -> Any:
        return ca.vertcat(10 * z[0], z[0] - 1, z[1])

    problem = toy(2, residuals, errors=lambda z, s: ca.fabs(z[0] - 1) / 1e-2, bounds=(-3.0, 3.0))
    assert solve("least_squares", problem).z[0] == pytest.approx(1 / 101, abs=1e-6)
    found = solve("race", problem, options={**SMALL, "generations": 10})
    assert (found.status, found.z[0]) == (Status.MET, pytest.approx(1, abs=1e-2))


def test_what_is_met_is_not_lowered_for_long_where_that_misses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Costs pull away from the target, by many iterations of gradient descent."""

    def costs(z: Any, s: Any) -> Any:
        return 100 * z[0] ** 2 + (z[0] - 1) ** 2 + 1e4 * z[1] ** 2

    monkeypatch.setattr(race, "finisher", lambda problem: race.GRADIENT)
    made = toy(2, objective=costs, errors=lambda z, s: ca.fabs(z[0] - 1) / 1e-2, bounds=(-3.0, 3.0))
    problem = replace(made, stop_when_met=False)
    for patience in (3, 1000):
        monkeypatch.setattr(race, "PATIENCE", patience)
        found = solve("race", problem, options={**SMALL, "generations": 10, "finisher_iterations": 100})
        after = next(k for k, row in enumerate(reversed(found.trace)) if row.max_violation <= 1)
        assert (after == 3) == (patience == 3) and found.z[0] == pytest.approx(1, abs=1e-2)
        assert found.status is not Status.INTERRUPTED


def test_a_few_iterations_may_miss_on_the_way() -> None:
    def gives_up(kind: str, *missed: float) -> bool:
        rows: Any = [SimpleNamespace(max_violation=each, iteration=k) for k, each in enumerate((0.5, *missed))]
        return race.Race(mesa(), race.RaceOptions(), 0, None, print, None)._gives_up(kind, rows)

    long = (2.0,) * PATIENCE
    assert gives_up(POLISH, *long) and not gives_up(FINISH, *long) and not gives_up(POLISH, *long[1:])
    assert not gives_up(POLISH, *long[1:], 1.5)  # it comes nearer
    assert not gives_up(POLISH, *long[2:], 0.9, 2.0)


def test_it_is_that_of_its_seed() -> None:
    first, again, other = (solve("race", mesa(), seed, SMALL) for seed in (1, 1, 2))
    same(first, again)
    assert not np.array_equal(first.z, other.z)


@pytest.mark.parametrize("make", [mesa, level])
def test_work_and_time_are_those_of_its_parts(make: Any) -> None:
    """What is met exactly needs no smoothing; what is missed goes through all stages."""
    rows: list[TraceRow] = []
    problem, count = counted(make(smoothing=(0.1, 0.0)))
    found = solve("race", problem, options=SMALL, monitor=rows.append)
    assert rows == list(found.trace)
    assert [row.iteration for row in rows] == list(range(len(rows)))
    for name in ("seconds", "rollouts", "jacobians"):
        column = [getattr(row, name) for row in rows]
        assert column == sorted(column)
    assert found.counts.rollouts == count.count["value"] + count.count["residuals"]
    assert found.counts.jacobians == count.count["jacobian"]
    assert Counts(*map(sum, zip(*(astuple(each.counts) for each in found.stages), strict=True))) == found.counts
    assert [each.smoothing for each in found.stages] == ([0.0] if make is mesa else [0.1, 0.0])
    assert np.array_equal(found.stages[-1].z, found.z)


@pytest.mark.parametrize("problem", [mesa(smoothing=(0.1, 0.0)), level()], ids=["mesa", "level"])
def test_it_goes_on_to_the_last_bit(problem: ShootingProblem) -> None:
    whole = solve("race", problem, options=SMALL)
    for stop in {0, 2, 3, 4, len(whole.trace) // 2, len(whole.trace) - 1}:
        part = solve("race", problem, options=SMALL, monitor=stop_at(stop))
        assert part.status is Status.INTERRUPTED
        assert len(part.trace) == stop + 1
        same(solve("race", problem, options=SMALL, checkpoint=through_json(part.checkpoint)), whole)


def test_what_it_keeps_on_its_way_is_a_checkpoint() -> None:
    kept: list[dict[str, Any]] = []
    whole = solve("race", mesa(), options=SMALL, keep=lambda make: kept.append(make()))
    assert len(kept) == len(whole.trace)
    for each in kept:
        same(solve("race", mesa(), options=SMALL, checkpoint=through_json(each)), whole)


def test_a_checkpoint_that_does_not_fit() -> None:
    saved = solve("race", mesa(), options=SMALL, monitor=stop_at(5)).checkpoint
    with pytest.raises(SymphysError, match="of the solver 'race'"):
        solve("cma", mesa(), checkpoint=through_json(saved))
    with pytest.raises(SymphysError, match="not of 'race'"):
        solve("race", mesa(), checkpoint={**saved, "solver": "cma"})
    with pytest.raises(SymphysError, match="2 variables, the problem 3"):
        solve("race", quadratic(), checkpoint=saved)
    with pytest.raises(SymphysError, match="damaged"):
        solve("race", mesa(), checkpoint={**saved, "parts": [{"kind": "search"}]})


def test_nothing_is_found_where_there_is_nothing() -> None:
    found = solve("race", level(), options=SMALL)
    assert (found.status, found.advice) == (Status.CONVERGED, PLATEAU_ADVICE)


def test_a_start_that_is_not_finite() -> None:
    found = solve("race", toy(2, lambda z, s: ca.sqrt(z - 1), guess=0.0))
    assert found.status is Status.NOT_FINITE
    assert "start" in found.advice


@pytest.mark.parametrize("at", [3, 30, 60])
def test_what_a_library_raises_is_a_failure(at: int) -> None:
    broken = failing(level(), ("value", "residuals", "jacobian"), at, RuntimeError("out of order"))
    found = solve("race", broken, options=SMALL)
    assert found.status is Status.FAILED
    assert "out of order" in found.advice


def test_a_search_among_splines_moves_smoothly() -> None:
    """Few numbers for each control; bounds give their unit."""
    problem = boxed(pendulum(), 8.0)
    problem = replace(problem, blocks=(replace(problem.blocks[0], shape=(1, problem.n)),))
    few, whole = (search_space(problem, problem.start(0), knots) for knots in (4, 0))
    assert few.columns is not None and few.columns.shape == (problem.n, 4)
    assert whole.columns is None and np.array_equal(whole.z(problem.start(0)), problem.start(0))
    assert few.z(np.ones(4)) == pytest.approx(np.full(problem.n, 4.0))
    steps = np.diff(few.z(np.array([0.0, 1.0, 0.0, 0.0])))
    assert abs(steps).max() < 0.4
