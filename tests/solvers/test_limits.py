"""A limit of a whole solve ends every solver in the same way, whatever the method and the stage."""

from __future__ import annotations

import itertools
import json
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from worlds.staged_toys import boxed, pendulum
from worlds.toys import PLAIN, counted, rosenbrock, solve, stop_at, through_json, toy, values
from worlds.windy import BEST, windy

from symphys.errors import ProblemError
from symphys.problem import json_schema, validate_options
from symphys.shooting import ShootingProblem
from symphys.solvers import SOLVERS, Outcome, Status, TraceRow, recorded_options, solve_multi_start, solver
from symphys.solvers.core import driver
from symphys.solvers.core.outcome import StopReason

AT_ONCE = {"max_seconds": 1e-9}
every_solver = pytest.mark.parametrize("name", list(SOLVERS))
STEPWISE = ("ilqr", "multiple_shooting")
ALONE = [*PLAIN, *STEPWISE, "race"]
"""Without samples."""
descents = pytest.mark.parametrize("name", [name for name in SOLVERS if name not in ALONE])


def problem_of(name: str, **more: Any) -> ShootingProblem:
    """One that takes the solver more than a few iterations."""
    if name in STEPWISE:
        return replace(boxed(pendulum(), 8.0), **more)
    return rosenbrock(**more) if name in ALONE else replace(windy(), **more)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second passes whenever the time is asked for: once as a solve begins, then for each row of the trace."""
    ticks = itertools.count()
    monkeypatch.setattr(driver, "time", SimpleNamespace(perf_counter=lambda: float(next(ticks))))


def spent(found: Outcome) -> bool:
    """Whether the time ended it."""
    return found.status is Status.BUDGET and "raise `max_seconds`" in found.advice


@every_solver
def test_the_time_is_up_after_the_first_row(name: str) -> None:
    found = solve(name, problem_of(name), options=AT_ONCE)
    assert spent(found)
    assert len(found.trace) == 1


@every_solver
@pytest.mark.usefixtures("clock")
def test_the_iteration_that_reaches_it_is_the_last(name: str) -> None:
    """And the best point so far is the result."""
    problem = problem_of(name)
    more = {} if name in ALONE else {"validation": 0, "rate": 0.05}
    found = solve(name, problem, options={"max_seconds": 4.5, **more})
    assert [row.seconds for row in found.trace] == [1, 2, 3, 4, 5]
    assert spent(found)
    if name in PLAIN:
        assert values(problem, found.z).merit[0] == found.trace[-1].best < found.trace[0].best


@pytest.mark.parametrize("name", PLAIN)
def test_one_that_is_not_reached_changes_nothing(name: str) -> None:
    free, limited = (solve(name, rosenbrock(), options=options) for options in ({}, {"max_seconds": 1e6}))
    assert (limited.status, limited.counts, len(limited.trace)) == (free.status, free.counts, len(free.trace))
    assert np.array_equal(limited.z, free.z)


@pytest.mark.parametrize("name", ["gradient", "least_squares", "cma"])
def test_a_method_that_has_converged_says_so_whatever_the_time(name: str) -> None:
    assert solve(name, rosenbrock(bounds=(1.0, 1.0)), options=AT_ONCE).status is Status.CONVERGED


@every_solver
def test_it_ends_the_solve_in_whatever_stage(name: str) -> None:
    """Iterations that are used up end a stage only."""
    staged = problem_of(name, smoothing=(1.0, 0.1, 0.0))
    budget = {"cma": {"evaluations": 1}, "race": {"rounds": 0}}.get(name, {"iterations": 1})
    assert len(solve(name, staged, options=budget).stages) == 3
    found = solve(name, staged, options=AT_ONCE)
    assert [stage.status for stage in found.stages] == [Status.BUDGET]
    assert spent(found)


@every_solver
@pytest.mark.usefixtures("clock")
def test_what_goes_on_counts_the_time_before(name: str) -> None:
    """At once over where that is used up already; else as without a break."""
    problem, count = counted(problem_of(name))
    quick = {} if name in ALONE else {"validation": 0}
    part = solve(name, problem, options=quick, monitor=stop_at(3))
    assert part.status is Status.INTERRUPTED and part.trace[-1].seconds == 4
    checkpoint, before = through_json(part.checkpoint), dict(count.count)
    over = solve(name, problem, options=quick | {"max_seconds": 3.5}, checkpoint=checkpoint)
    assert spent(over) and len(over.trace) == 4
    assert name not in (*PLAIN, *STEPWISE) or dict(count.count) == before
    longer = solve(name, problem, options=quick | {"max_seconds": 6.5}, checkpoint=checkpoint)
    assert spent(longer)
    assert [row.seconds for row in longer.trace] == [1, 2, 3, 4, 5, 6, 7]


@descents
@pytest.mark.usefixtures("clock")
def test_the_last_point_of_a_descent_is_validated(name: str) -> None:
    """Which without a limit it would be after all iterations, and sooner with patience."""
    for validation in (0, 32):
        options = {"max_seconds": 6.5, "patience": 1.0, "validation": validation, "rate": 0.1, "samples": 16}
        problem = windy()
        found = SOLVERS[name].solve(problem, np.array([3.0, 3.0]), SOLVERS[name].Options(**options))
        assert spent(found) and len(found.trace) == 7
        assert np.linalg.norm(found.z - 3.0) > 0.5


@pytest.mark.usefixtures("clock")
def test_cma_on_samples_validates_its_last_mean() -> None:
    options = {"max_seconds": 6.5, "every": 1000, "population": 10}
    found = SOLVERS["cma"].solve(windy(), np.array([3.0, 3.0]), SOLVERS["cma"].Options(**options))
    assert spent(found) and len(found.trace) == 7
    assert not np.array_equal(found.z, [3.0, 3.0])


@pytest.mark.usefixtures("clock")
def test_where_the_start_is_kept_the_advice_is_that_of_the_limit() -> None:
    """There was no time to find better; on samples, and where smoothing leads away from the start."""
    leaps = SOLVERS["stochastic"].Options(max_seconds=1.5, rate=1.0)
    found = SOLVERS["stochastic"].solve(windy(), BEST, leaps)
    assert spent(found) and np.array_equal(found.z, BEST)
    moved = toy(1, lambda z, s: z - 1 - s, guess=1.0, smoothing=(1.0, 0.0))
    found = solve("gradient", moved, options={"max_seconds": 1.5})
    assert found.stages[0].z[0] > 1
    assert spent(found) and found.z[0] == 1


def test_side_by_side() -> None:
    problem, chosen = rosenbrock(), solver("gradient")
    starts = [problem.start(seed) for seed in range(3)]
    for found in solve_multi_start(chosen, problem, starts, chosen.Options(**AT_ONCE)):
        assert spent(found) and len(found.trace) == 1


@every_solver
@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan")])
def test_a_time_that_cannot_be(name: str, bad: float) -> None:
    with pytest.raises(ValueError, match="max_seconds"):
        SOLVERS[name].Options(max_seconds=bad)


@every_solver
@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (0, r"solver\.x: max_seconds must be above 0"),
        (-2.5, r"solver\.x: max_seconds must be above 0"),
        (float("nan"), r"solver\.x\.max_seconds: must be a number, not nan"),
        ("long", r'solver\.x\.max_seconds: must be a number, not the text "long"'),
        (True, r"solver\.x\.max_seconds: must be a number, not true"),
    ],
)
def test_a_table_that_cannot_be(name: str, bad: object, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        validate_options(SOLVERS[name].Options, {"max_seconds": bad}, "file.toml", "solver.x")


@every_solver
def test_the_key_of_a_run_without_it_stays_the_same(name: str) -> None:
    kind = SOLVERS[name].Options
    assert "max_seconds" not in recorded_options(kind())
    assert recorded_options(kind(max_seconds=10.0)) == recorded_options(kind()) | {"max_seconds": 10.0}


def test_the_schema_describes_it_and_is_json() -> None:
    schema = json_schema({name: each.Options for name, each in SOLVERS.items()})
    json.dumps(schema, allow_nan=False)
    for each in SOLVERS.values():
        options = schema["$defs"][each.Options.__name__]
        assert options["properties"]["max_seconds"]["type"] == "number"
        assert options["properties"]["max_seconds"]["description"].startswith("the time that a solve may take [s]")


@every_solver
def test_another_limit_is_a_field_and_its_end(name: str) -> None:
    """Nothing else knows which limits there are."""
    kind: Any = SOLVERS[name].Options

    @dataclass(frozen=True)
    class Enough(kind):  # type: ignore[misc]
        enough: float = 1.0

        def spent(self, row: TraceRow) -> StopReason | None:
            good = row.iteration > 0 and row.best < self.enough
            return StopReason(Status.CONVERGED, "good enough") if good else super().spent(row)

    problem = problem_of(name, smoothing=(1.0, 0.0))
    found = SOLVERS[name].solve(problem, problem.start(0), Enough(enough=1e9))
    assert (found.status, found.advice) == (Status.CONVERGED, "good enough")
    assert (len(found.trace), len(found.stages)) == (2, 1)
