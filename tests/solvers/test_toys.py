"""Every solver finds the answer of every toy within bounds, and its counts and trace are those of the evaluations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from worlds.toys import (
    PENALTY,
    PLAIN,
    constrained,
    counted,
    quadratic,
    require,
    rosenbrock,
    solve,
    stop_at,
    target,
    through_json,
    toy,
    values,
)

from symphys.solvers import SOLVERS, Status

WAYS: list[tuple[str, dict[str, Any]]] = [
    ("gradient", {}),
    ("gradient", {"method": "gradient", "rates": (0.05,)}),
    ("gradient", {"method": "momentum", "rates": (0.02,), "momentum": 0.5}),
    ("gradient", {"method": "adam", "rates": (1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001)}),
    ("gradient", {"method": "adam", "backtracking": 0, "rates": (1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001)}),
    ("least_squares", {}),
    ("ipopt", {}),
    ("ipopt", {"hessian": "exact"}),
    ("cma", {}),
]
IDS = [
    f"{name}-{'-'.join(str(value) for value in options.values() if isinstance(value, str | int))}"
    for name, options in WAYS
]
every_way = pytest.mark.parametrize(("name", "options"), WAYS, ids=IDS)
every_solver = pytest.mark.parametrize("name", PLAIN)


@every_way
def test_quadratic(name: str, options: dict[str, Any]) -> None:
    found = solve(name, quadratic(), options=options)
    assert found.z == pytest.approx([1, 2, 3], abs=1e-3)
    assert found.status is not Status.MET


@every_solver
def test_converges_on_a_quadratic(name: str) -> None:
    found = solve(name, quadratic())
    assert (found.status, found.advice) == (Status.CONVERGED, "")
    assert found.z == pytest.approx([1, 2, 3], abs=1e-5)


@every_solver
def test_rosenbrock(name: str) -> None:
    found = solve(name, rosenbrock())
    assert found.z == pytest.approx([1, 1], abs=1e-3)


@every_way
def test_target_is_met_and_the_solve_stops_there(name: str, options: dict[str, Any]) -> None:
    problem = target()
    found = solve(name, problem, options=options)
    assert (found.status, found.advice) == (Status.MET, "")
    errors = values(problem, found.z).errors[0]
    assert problem.met(errors)
    assert found.trace[-1].max_violation == pytest.approx(errors.max())
    assert all(row.max_violation > 1 for row in found.trace[:-1])


@every_solver
def test_goes_on_past_met_where_asked_to(name: str) -> None:
    found = solve(name, target(stop_when_met=False))
    assert found.status is Status.CONVERGED
    assert found.z == pytest.approx([2, -1], abs=1e-4)


@every_way
def test_bounds_hold_at_every_evaluation(name: str, options: dict[str, Any]) -> None:
    lower, upper = 0.3, 1.7
    problem, watch = counted(quadratic(bounds=(lower, upper), guess=0.5, scale=0.9))
    found = solve(name, problem, options=options)
    assert found.z == pytest.approx([1, upper, upper], abs=2e-3)
    points = np.array(watch.points)
    assert np.all((points >= lower) & (points <= upper))


@every_solver
def test_start_outside_the_bounds_is_moved_inside(name: str) -> None:
    problem = quadratic(bounds=(0.0, 5.0))
    found = SOLVERS[name].solve(problem, np.array([-3.0, 9.0, 1.0]), SOLVERS[name].Options())
    assert found.trace[0].objective == pytest.approx(values(problem, [0, 5, 1]).merit[0])
    assert found.z == pytest.approx([1, 2, 3], abs=1e-4)


@every_solver
def test_equal_bounds_hold_a_variable(name: str) -> None:
    problem = toy(1, lambda z, s: z - 1, bounds=(3.0, 3.0), guess=3.0)
    assert solve(name, problem).z == pytest.approx([3.0], abs=0)


def test_ipopt_meets_the_constraint_exactly() -> None:
    for hessian in ("exact", "limited-memory"):
        found = solve("ipopt", constrained(), options={"hessian": hessian})
        assert found.status is Status.CONVERGED
        assert found.z == pytest.approx([1, 0], abs=1e-7)
        assert found.counts.jacobians > 0


@pytest.mark.parametrize("name", ["gradient", "least_squares", "cma"])
def test_the_others_follow_the_penalty(name: str) -> None:
    found = solve(name, constrained())
    assert found.z == pytest.approx(np.array([1, 0]) + 1 / (1 + 2 * PENALTY), abs=1e-4)
    assert found.status is Status.CONVERGED
    assert "not everything is met" in found.advice


@every_solver
def test_scale_changes_the_way_not_the_answer(name: str) -> None:
    for scale in (1e-2, 1e2):
        assert solve(name, quadratic(scale=scale)).z == pytest.approx([1, 2, 3], abs=1e-2)


@pytest.mark.parametrize("name", ["gradient", "least_squares"])
@pytest.mark.parametrize("problem", [quadratic(), rosenbrock(), target()], ids=["quadratic", "rosenbrock", "target"])
def test_counts(name: str, problem: Any) -> None:
    watched, watch = counted(problem)
    found = solve(name, watched)
    assert found.counts.rollouts == watch.count["value"] + watch.count["residuals"]
    assert found.counts.gradients == watch.count["gradient"]
    assert found.counts.jacobians == watch.count["jacobian"]
    assert found.counts.hessians == 0


def test_counts_of_cma_are_whole_generations_and_the_guess() -> None:
    watched, watch = counted(target())
    found = solve("cma", watched, options={"population": 10})
    assert found.counts.rollouts == watch.count["value"]
    assert found.counts.rollouts == 1 + 10 * (len(found.trace) - 1)
    assert watch.calls["value"] == len(found.trace)


@pytest.mark.parametrize("hessian", ["exact", "limited-memory"])
def test_counts_of_ipopt_are_its_own_and_one_rollout_an_iterate(hessian: str) -> None:
    lines: list[str] = []
    watched, watch = counted(constrained())
    unscaled = {"nlp_scaling_method": "none"}  # scaling takes a gradient that IPOPT's text does not tell of
    found = solve("ipopt", watched, options={"hessian": hessian, "options": unscaled}, log=lines.append)
    reported = {
        line.split("=")[0].strip(): int(line.split("=")[1])
        for line in lines
        if line.startswith("Number of") and "=" in line
    }
    rollouts = (
        reported["Number of objective function evaluations"] + reported["Number of equality constraint evaluations"]
    )
    assert found.counts.gradients == reported["Number of objective gradient evaluations"]
    assert found.counts.jacobians == reported["Number of equality constraint Jacobian evaluations"]
    assert found.counts.hessians == (reported["Number of Lagrangian Hessian evaluations"] if hessian == "exact" else 0)
    assert found.counts.rollouts == rollouts + watch.count["value"]


@every_way
def test_trace(name: str, options: dict[str, Any]) -> None:
    seen = []
    found = solve(name, target(), options=options, monitor=seen.append)
    assert [row.iteration for row in found.trace] == list(range(len(found.trace)))
    assert [row.iteration for row in seen] == list(range(len(seen)))
    assert found.trace[0].objective == pytest.approx(values(target(), np.zeros(2)).objective[0])
    for field in ("rollouts", "gradients", "jacobians", "hessians", "seconds"):
        numbers = [getattr(row, field) for row in found.trace]
        assert numbers == sorted(numbers)
        if field != "seconds":
            assert numbers[-1] == getattr(found.counts, field)
    assert found.trace[-1].best == found.trace[-1].objective


@every_solver
def test_nothing_is_printed_read_or_written(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ipopt.opt").write_text("max_iter 1\n")
    (tmp_path / "cma_signals.in").write_text("{'maxiter': 1}\n")
    assert solve(name, quadratic()).status is Status.CONVERGED
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cma_signals.in", "ipopt.opt"]
    assert capfd.readouterr() == ("", "")


@every_solver
def test_a_seed_means_the_same_twice(name: str) -> None:
    runs = [solve(name, target(), seed=seed) for seed in (3, 3, 4)]
    assert np.array_equal(runs[0].z, runs[1].z)
    assert not np.array_equal(runs[0].z, runs[2].z)
    assert all(run.status is Status.MET for run in runs)


def test_cma_leaves_the_global_random_stream_alone() -> None:
    np.random.seed(7)
    before = np.random.get_state()[1].copy()
    solve("cma", target())
    assert np.array_equal(before, np.random.get_state()[1])


@every_way
@pytest.mark.parametrize("backend", ["c", "simd"])
def test_compiled_toys(backend: str, name: str, options: dict[str, Any]) -> None:
    require(backend)
    assert solve(name, quadratic(backend=backend), options=options).z == pytest.approx([1, 2, 3], abs=1e-3)
    assert solve(name, target(backend=backend), options=options).status is Status.MET
    if name == "ipopt":
        assert solve(name, constrained(backend=backend), options=options).z == pytest.approx([1, 0], abs=1e-7)


@every_solver
@pytest.mark.parametrize("backend", ["casadi", "simd"])
def test_what_a_problem_tells_of_its_best_point_is_in_every_row(name: str, backend: str) -> None:
    """By name; the last row tells of what was found."""
    require(backend)
    problem = toy(2, residuals=lambda z, s: z - 3, outputs=True, backend=backend)
    found = solve(name, problem)
    assert all(list(row.outputs) == ["sum [m]"] for row in found.trace)
    assert found.trace[-1].outputs["sum [m]"] == pytest.approx(found.z.sum(), rel=1e-6)


BOUNDS = [(-np.inf, np.inf), (0, np.inf), (-np.inf, 5), (0, 5), (-1, 0.9), (0, 1e-3)]
DEVIATIONS: list[dict[str, Any]] = [
    {},
    {"sigma": 30.0},
    {"options": {"maxstd": 0.02}},
    {"options": {"minstd": 1e-4}},
]


@few(
    ("bounds", "options"),
    [
        pytest.param(bounds, options, marks=() if bounds == (-1, 0.9) or not options else pytest.mark.thorough)
        for options in DEVIATIONS
        for bounds in BOUNDS
    ],
    5,
)
def test_cma_with_one_variable(bounds: tuple[float, float], options: dict[str, Any]) -> None:
    """Bounded on both sides, on one, on none; standard deviations beyond their limits."""
    lower, upper = bounds
    problem, watch = counted(toy(1, lambda z, s: z - 1, bounds=bounds, guess=min(0.5, upper)))
    found = solve("cma", problem, options=options)
    assert found.z == pytest.approx([min(1.0, upper)], abs=2e-3)
    assert found.status in (Status.CONVERGED, Status.STALLED)
    points = np.array(watch.points)
    assert np.all((points >= lower) & (points <= upper))


def test_cma_with_one_variable_that_may_vary_of_several() -> None:
    """The others are held by equal bounds."""
    problem = quadratic()
    (block,) = problem.blocks
    held = replace(block, lower=np.array([0.0, 0, 0]), upper=np.array([0.0, 0, 3.5]))
    assert solve("cma", replace(problem, blocks=(held,))).z == pytest.approx([0, 0, 3], abs=1e-4)


def test_cma_with_one_variable_goes_on_to_the_last_bit() -> None:
    problem = toy(1, lambda z, s: z - 1, bounds=(-1.0, 0.9), guess=0.5)
    whole, part = solve("cma", problem), solve("cma", problem, monitor=stop_at(7))
    rest = solve("cma", problem, checkpoint=through_json(part.checkpoint))
    assert np.array_equal(rest.z, whole.z) and rest.counts == whole.counts
