"""Each stage of smoothing starts from the best point of the one before, and the last decides, under every solver."""

from __future__ import annotations

from dataclasses import astuple, replace
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few
from worlds.toys import PLAIN, failing, solve, stop_at, through_json, toy, values

from symphys.errors import SymphysError
from symphys.maths.smoothing import positive
from symphys.shooting import ShootingProblem
from symphys.solvers import Counts, Outcome, StageResult, Status, TraceRow, solve_multi_start, solver
from symphys.solvers.core import driver
from symphys.solvers.core.convergence import PLATEAU_ADVICE

SMOOTHINGS = (1.0, 0.1, 0.0)
every_solver = pytest.mark.parametrize("name", PLAIN)
replayed = pytest.mark.parametrize("name", ["gradient", "least_squares", "cma"])


def moving(smoothing: tuple[float, ...] = SMOOTHINGS, **more: Any) -> ShootingProblem:
    """The answer moves with the smoothing: x = 1 + s."""

    def miss(z: Any, s: Any) -> Any:
        return z - 1 - s

    return toy(1, miss, errors=lambda z, s: ca.fabs(miss(z, s)) / 1e-3, guess=5.0, smoothing=smoothing, **more)


def held(smoothing: tuple[float, ...]) -> ShootingProblem:
    """What a push z moves: nothing below 1, as friction holds it; with smoothing it creeps. It should move by 2."""

    def miss(z: Any, s: Any) -> Any:
        return positive(z - 1, s) - 2

    return toy(1, miss, errors=lambda z, s: ca.fabs(miss(z, s)) / 1e-3, smoothing=smoothing)


def bent() -> ShootingProblem:
    """A valley that bends the more the smaller the smoothing is, so that every stage has its iterations."""
    return toy(
        2, lambda z, s: ca.vertcat(1 - z[0], 10 / (1 + s) * (z[1] - z[0] ** 2)), guess=-1.0, smoothing=SMOOTHINGS
    )


def total(stages: tuple[StageResult, ...]) -> Counts:
    """The work of all."""
    return Counts(*map(sum, zip(*(astuple(stage.counts) for stage in stages), strict=True)))


def without_seconds(stages: tuple[StageResult, ...]) -> list[Any]:
    """All but the seconds, to compare."""
    return [repr(replace(stage, seconds=0.0)) for stage in stages]


def same(a: Outcome, b: Outcome) -> None:
    """All but the seconds."""
    assert (a.status, a.counts) == (b.status, b.counts)
    assert np.array_equal(a.z, b.z)
    rows = [
        [(*astuple(replace(row, seconds=0))[:-1], *row.outputs.values()) for row in outcome.trace] for outcome in (a, b)
    ]
    np.testing.assert_array_equal(rows[0], rows[1])
    assert without_seconds(a.stages) == without_seconds(b.stages)


@every_solver
def test_every_stage_has_its_result(name: str) -> None:
    """What is met at s > 0 ends its stage, not the solve."""
    found = solve(name, moving())
    assert found.status is Status.MET
    assert found.z == pytest.approx([1.0], abs=1e-3)
    smoothings = [row.smoothing for row in found.trace]
    assert smoothings == sorted(smoothings, reverse=True) and set(smoothings) == set(SMOOTHINGS)
    assert [stage.smoothing for stage in found.stages] == list(SMOOTHINGS)
    for stage in found.stages:
        assert stage.status is Status.MET and stage.max_violation <= 1
        assert stage.z == pytest.approx([1 + stage.smoothing], abs=1e-3)
        assert stage.objective == values(moving(), stage.z, stage.smoothing).objective[0]
    assert np.array_equal(found.stages[-1].z, found.z)


@every_solver
def test_a_stage_starts_where_the_one_before_ended(name: str) -> None:
    problem = moving(stop_when_met=False)
    found = solve(name, problem)
    for before, smoothing in zip(found.stages, SMOOTHINGS[1:], strict=False):
        first = next(row for row in found.trace if row.smoothing == smoothing)
        assert first.objective == values(problem, before.z, smoothing).objective[0]


@every_solver
def test_work_and_time_of_the_stages_are_those_of_the_solve(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock advances by one second with each row."""
    rows: list[TraceRow] = []
    monkeypatch.setattr(driver, "time", SimpleNamespace(perf_counter=lambda: float(len(rows))))
    found = solve(name, moving(), monitor=rows.append)
    assert total(found.stages) == found.counts
    assert all(sum(astuple(stage.counts)) > 0 for stage in found.stages)
    in_stage = [[row.smoothing for row in found.trace].count(smoothing) for smoothing in SMOOTHINGS]
    assert [stage.seconds for stage in found.stages] == in_stage


@every_solver
def test_one_number_is_one_stage(name: str) -> None:
    found = solve(name, moving((0.25,)))
    assert found.z == pytest.approx([1.25], abs=1e-3)
    (stage,) = found.stages
    assert (stage.smoothing, stage.status, stage.counts) == (0.25, found.status, found.counts)


@every_solver
def test_stages_need_not_end_at_zero(name: str) -> None:
    found = solve(name, moving((1.0, 0.1)))
    assert found.status is Status.MET
    assert found.z == pytest.approx([1.1], abs=1e-3)


@pytest.mark.parametrize("name", ["gradient", "least_squares"])
def test_what_friction_holds_is_let_go(name: str) -> None:
    stuck = solve(name, held((0.0,)))
    assert (stuck.status, stuck.advice, stuck.z.tolist()) == (Status.CONVERGED, PLATEAU_ADVICE, [0.0])
    assert "stages" in stuck.advice
    freed = solve(name, held((1.0, 0.1, 0.0)))
    assert freed.status is Status.MET
    assert freed.z == pytest.approx([3.0], abs=1e-3)


def test_each_stage_has_the_whole_budget() -> None:
    found = solve("gradient", bent(), options={"iterations": 4})
    assert [stage.status for stage in found.stages] == [Status.BUDGET] * 3
    assert [stage.counts.gradients for stage in found.stages] == [5] * 3
    assert found.status is Status.BUDGET


def broken_at(smoothing: float) -> ShootingProblem:
    """As ``moving``, but it cannot be simulated at one smoothing."""
    return toy(
        1,
        lambda z, s: ca.if_else(s == smoothing, np.nan, z - 1 - s),
        errors=lambda z, s: ca.fabs(z - 1 - s) / 1e-3,
        guess=5.0,
        smoothing=SMOOTHINGS,
    )


@every_solver
@pytest.mark.parametrize("smoothing", SMOOTHINGS[:2])
def test_a_stage_that_cannot_be_simulated_is_passed(name: str, smoothing: float) -> None:
    found = solve(name, broken_at(smoothing))
    assert found.status is Status.MET
    assert found.z == pytest.approx([1.0], abs=1e-3)
    broken = found.stages[SMOOTHINGS.index(smoothing)]
    assert broken.status is Status.NOT_FINITE
    assert np.isnan(broken.objective)
    assert broken.z == pytest.approx([5.0] if smoothing == SMOOTHINGS[0] else [2.0], abs=1e-3)


@every_solver
def test_a_last_stage_that_cannot_be_simulated_leaves_the_point_before(name: str) -> None:
    found = solve(name, broken_at(0.0))
    assert found.status is Status.NOT_FINITE
    assert found.z == pytest.approx([1.1], abs=1e-3)
    assert [stage.status for stage in found.stages] == [Status.MET, Status.MET, Status.NOT_FINITE]


def test_a_foreign_error_belongs_to_its_stage() -> None:
    whole = solve("gradient", bent())
    at = whole.stages[0].counts.rollouts + 1
    found = solve("gradient", failing(bent(), ["value"], at, RuntimeError("out of order")))
    assert [stage.status for stage in found.stages][1:] == [Status.FAILED]
    assert found.status is Status.FAILED and "out of order" in found.advice
    assert total(found.stages) == found.counts


@pytest.mark.slow
@replayed
@few("problem", [pytest.param(moving(), id="moving", marks=pytest.mark.thorough), pytest.param(bent(), id="bent")], 1)
def test_goes_on_in_any_stage_to_the_last_bit(name: str, problem: ShootingProblem) -> None:
    whole = solve(name, problem, seed=2)
    first, second = (sum(row.smoothing >= smoothing for row in whole.trace) for smoothing in SMOOTHINGS[:2])
    for stop in {1, first - 1, first, second - 1, second, len(whole.trace) - 1}:
        part = solve(name, problem, seed=2, monitor=stop_at(stop))
        assert part.status is Status.INTERRUPTED
        smoothing = whole.trace[stop].smoothing
        assert [stage.smoothing for stage in part.stages] == list(SMOOTHINGS[: SMOOTHINGS.index(smoothing) + 1])
        assert part.stages[-1].status is Status.INTERRUPTED
        assert total(part.stages) == part.counts
        assert without_seconds(part.stages[:-1]) == without_seconds(whole.stages[: len(part.stages) - 1])
        same(solve(name, problem, seed=2, checkpoint=through_json(part.checkpoint)), whole)


@pytest.mark.parametrize("name", ["gradient", "least_squares"])
def test_interrupted_between_two_stages(name: str) -> None:
    whole = solve(name, bent())
    kind = "gradient" if name == "gradient" else "jacobian"
    at = getattr(whole.stages[0].counts, f"{kind}s") + 1
    part = solve(name, failing(bent(), [kind], at, KeyboardInterrupt()))
    assert [(stage.smoothing, stage.status) for stage in part.stages] == [(1.0, Status.INTERRUPTED)]
    same(solve(name, bent(), checkpoint=through_json(part.checkpoint)), whole)


def test_ipopt_goes_on_in_its_stage() -> None:
    whole = solve("ipopt", bent())
    stop = len([row for row in whole.trace if row.smoothing == 1.0]) + 1
    part = solve("ipopt", bent(), monitor=stop_at(stop))
    rest = solve("ipopt", bent(), checkpoint=through_json(part.checkpoint))
    assert without_seconds(rest.stages[:1]) == without_seconds(whole.stages[:1])
    assert [stage.smoothing for stage in rest.stages] == list(SMOOTHINGS)
    assert rest.status is whole.status
    assert rest.z == pytest.approx(whole.z, abs=1e-6)
    assert total(rest.stages) == rest.counts


def test_a_checkpoint_of_other_stages_is_refused() -> None:
    part = solve("gradient", moving(stop_when_met=False), monitor=lambda row: stop_in(row, 0.0))
    saved = through_json(part.checkpoint)
    for smoothings in ((0.0,), (1.0, 0.1), (1.0, 0.2, 0.0)):
        with pytest.raises(SymphysError, match="other stages"):
            solve("gradient", moving(smoothings), checkpoint=saved)
    with pytest.raises(SymphysError, match="damaged"):
        solve("gradient", moving(), checkpoint=saved | {"stages": [{"smoothing": 1.0, "status": "odd"}]})


def stop_in(row: Any, smoothing: float) -> None:
    """Interrupt in the stage of that smoothing."""
    if row.smoothing == smoothing:
        raise KeyboardInterrupt


@pytest.mark.parametrize("name", ["gradient", "least_squares"])
def test_side_by_side_they_are_those_of_each_alone(name: str) -> None:
    """Solves that are in different stages share no batch, and each goes its own way."""
    problem, chosen = bent(), solver(name)
    starts = [problem.start(seed) for seed in range(4)]
    for seed, found in enumerate(solve_multi_start(chosen, problem, starts, chosen.Options())):
        same(found, solve(name, problem, seed))


def test_the_log_tells_how_each_stage_ended() -> None:
    lines: list[str] = []
    solve("gradient", moving(), log=lines.append)
    assert lines == [
        "stage 1 of 3: smoothing 1",
        "met",
        "stage 2 of 3: smoothing 0.1",
        "met",
        "stage 3 of 3: smoothing 0",
        "met",
    ]
