"""An interrupted solve goes on as if there had been no break."""

from __future__ import annotations

from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from worlds.toys import PLAIN, failing, rosenbrock, solve, stop_at, target, through_json, values

from symphys.errors import SymphysError
from symphys.solvers import SOLVERS, Outcome, Status

EXACT: list[tuple[str, dict[str, Any]]] = [
    ("gradient", {}),
    ("gradient", {"method": "momentum", "rates": (0.02,)}),
    ("gradient", {"method": "adam"}),
    ("least_squares", {}),
    ("cma", {}),
    ("cma", {"options": {"CMA_diagonal": 5}, "population": 7}),
]
THOROUGH = pytest.mark.thorough
every_solver = pytest.mark.parametrize("name", PLAIN)


def same(a: Outcome, b: Outcome) -> None:
    """All but the seconds."""
    assert (a.status, a.counts) == (b.status, b.counts)
    assert np.array_equal(a.z, b.z)
    rows = [
        [(*astuple(replace(row, seconds=0))[:-1], *row.outputs.values()) for row in outcome.trace] for outcome in (a, b)
    ]
    np.testing.assert_array_equal(rows[0], rows[1])


@few(("name", "options"), EXACT, 2)
@few("problem", [pytest.param(rosenbrock(), id="rosenbrock"), pytest.param(target(), id="target", marks=THOROUGH)], 1)
def test_the_same_to_the_last_bit(name: str, options: dict[str, Any], problem: Any) -> None:
    whole = solve(name, problem, seed=2, options=options)
    for stop in {0, 1, 2, len(whole.trace) // 2, len(whole.trace) - 2, len(whole.trace) - 1}:
        part = solve(name, problem, seed=2, options=options, monitor=stop_at(stop))
        assert part.status is Status.INTERRUPTED
        assert len(part.trace) == stop + 1
        rest = solve(name, problem, seed=2, options=options, checkpoint=through_json(part.checkpoint))
        same(rest, whole)


@pytest.mark.parametrize("name", ["gradient", "least_squares", "cma"])
@few("evaluation", [1, 2, 5, 8], 2)
def test_interrupted_in_the_middle_of_an_evaluation(name: str, evaluation: int) -> None:
    problem = rosenbrock()
    kind = {"gradient": "value", "least_squares": "residuals", "cma": "value"}[name]
    part = solve(name, failing(problem, [kind], evaluation, KeyboardInterrupt()))
    assert part.status is Status.INTERRUPTED
    assert part.counts == (part.counts if not part.trace else type(part.counts)(*astuple(part.trace[-1])[1:5]))
    rest = solve(name, problem, checkpoint=through_json(part.checkpoint))
    same(rest, solve(name, problem))


def test_twice_interrupted() -> None:
    problem = rosenbrock()
    checkpoint: dict[str, Any] = {}
    for stop in (3, 6, 9):
        part = solve("gradient", problem, monitor=stop_at(stop), checkpoint=checkpoint)
        checkpoint = through_json(part.checkpoint)
    same(solve("gradient", problem, checkpoint=checkpoint), solve("gradient", problem))


def test_ipopt_goes_on_from_its_last_point() -> None:
    whole = solve("ipopt", rosenbrock())
    part = solve("ipopt", rosenbrock(), monitor=stop_at(5))
    assert (part.status, len(part.trace)) == (Status.INTERRUPTED, 6)
    rest = solve("ipopt", rosenbrock(), checkpoint=through_json(part.checkpoint))
    assert rest.status is whole.status is Status.CONVERGED
    assert rest.z == pytest.approx(whole.z, abs=1e-6)
    assert repr(rest.trace[:6]) == repr(part.trace)
    assert [row.iteration for row in rest.trace] == list(range(len(rest.trace)))
    assert rest.counts.gradients > part.counts.gradients >= 5


def test_ipopt_interrupted_in_the_middle_of_an_evaluation() -> None:
    problem = rosenbrock()
    part = solve("ipopt", failing(problem, ["value"], 4, KeyboardInterrupt()))
    assert (part.status, len(part.trace)) == (Status.INTERRUPTED, 3)
    assert solve("ipopt", problem, checkpoint=part.checkpoint).status is Status.CONVERGED


@every_solver
def test_the_best_so_far_is_kept(name: str) -> None:
    part = solve(name, rosenbrock(), monitor=stop_at(6))
    merit = values(rosenbrock(), part.z).merit[0]
    assert merit == part.trace[-1].best <= part.trace[0].objective
    assert "goes on" in part.advice


@every_solver
def test_seconds_go_on(name: str) -> None:
    part = solve(name, rosenbrock(), monitor=stop_at(4))
    checkpoint = through_json(part.checkpoint) | {"seconds": 1e6}
    rest = solve(name, rosenbrock(), checkpoint=checkpoint)
    assert rest.trace[4].seconds < 1e6
    assert rest.trace[-1].seconds > 1e6


@every_solver
def test_interrupted_at_once(name: str) -> None:
    part = solve(name, failing(rosenbrock(), ("value", "gradient", "jacobian"), 1, KeyboardInterrupt()))
    assert part.status is Status.INTERRUPTED
    assert part.checkpoint == {}
    assert np.array_equal(part.z, rosenbrock().start(0))


@every_solver
def test_a_checkpoint_that_does_not_fit(name: str) -> None:
    good = through_json(solve(name, rosenbrock(), monitor=stop_at(3)).checkpoint)
    other = next(each for each in SOLVERS if each != name)
    with pytest.raises(SymphysError, match="solver"):
        solve(other, rosenbrock(), checkpoint=good)
    with pytest.raises(SymphysError, match="damaged"):
        solve(name, rosenbrock(), checkpoint={key: good[key] for key in good if key != "rows"})
    with pytest.raises(SymphysError, match="damaged"):
        solve(name, rosenbrock(), checkpoint=good | {"state": {"iteration": "many"}})
    long = good["best"] | {"z": [0.0, 0.0, 0.0]}
    with pytest.raises(SymphysError, match="3 variables"):
        solve(name, rosenbrock(), checkpoint=good | {"best": long})


def test_a_replay_that_drifts_is_noticed() -> None:
    good = through_json(solve("cma", rosenbrock(), monitor=stop_at(5)).checkpoint)
    with pytest.raises(SymphysError, match="elsewhere"):
        solve("cma", rosenbrock(), checkpoint=good | {"state": good["state"] | {"sigma": 77.0}})
