"""Another run as the guess: variables by name on any grid, its motion, its multipliers, what is said of the rest."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tools.repeats import few

import symphys
from symphys import Problem, Solution, SymphysError
from symphys.report import write_run_report
from symphys.results.file_names import LOG, MULTIPLIERS, TRAJECTORY
from symphys.runs import make_jobs, read_guess_run
from symphys.runs.guess import resampled, with_guess
from symphys.solvers import SOLVERS
from symphys.transcription import transcribe

CART = """
[simulation]
duration = 1.0
dt = 0.05

[[body]]
name = "cart"
shape = { box = { size = [0.3, 0.2, 0.1] } }
mass = 1

[[joint]]
name = "rail"
between = ["world", "cart"]
slider = { axis = [1, 0, 0] }
motor = { torque = { torque = 20 } }

[[variable]]
name = "push"
sets = "rail.command"
knots = 5
interpolation = "linear"
guess = 0.5
lower = -20
upper = 20

[[cost]]
name = "effort"
at = "always"
squares = "rail.command"
weight = 0.01

[[target]]
name = "there"
value = "[rail.position - 1, rail.rate]"
tolerance = 0.01
weight = 100

[objective]
stop = "converged"
"""


@pytest.fixture(scope="module")
def cart(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    path = tmp_path_factory.mktemp("cart") / "cart.toml"
    path.write_text(CART, encoding="utf-8")
    return symphys.load(path)


@pytest.fixture(scope="module")
def found(cart: Problem, tmp_path_factory: pytest.TempPathFactory) -> Solution:
    """By multiple shooting, which keeps its multipliers."""
    return symphys.solve(cart, "multiple_shooting", backend="casadi", folder=tmp_path_factory.mktemp("found"))


def taken(problem: Problem, run: Solution) -> tuple[Problem, tuple[str, ...]]:
    made, origin = with_guess(problem, read_guess_run(run.folder))
    return made, origin.notes


def test_knots_of_another_number_are_the_same_control() -> None:
    """Where the finer grid has the coarser one's knots, as steps or as lines, and back; means of what is finer."""
    rows = np.random.default_rng(0).standard_normal((2, 5))
    for kind in ("linear", "constant"):
        assert resampled(rows, kind, 5, kind) == pytest.approx(rows)
    assert resampled(rows, "constant", 15, "constant") == pytest.approx(np.repeat(rows, 3, axis=1))
    assert resampled(np.repeat(rows, 3, axis=1), "constant", 5, "constant") == pytest.approx(rows)
    fine = resampled(rows, "linear", 9, "linear")
    assert fine[:, ::2] == pytest.approx(rows) and fine[:, 1] == pytest.approx((rows[:, 0] + rows[:, 1]) / 2)
    assert resampled(fine, "linear", 5, "linear") == pytest.approx(rows)
    lines = np.array([[0.0, 1.0, 0.0]])
    assert resampled(lines, "linear", 2, "constant") == pytest.approx(np.array([[0.5, 0.5]]))
    assert resampled(lines, "linear", 4, "constant") == pytest.approx(np.array([[0.25, 0.75, 0.75, 0.25]]))
    assert resampled(lines, "linear", 1, "linear") == pytest.approx(np.array([[0.5]]))
    assert resampled(np.array([[1.0, 3.0]]), "constant", 3, "linear") == pytest.approx(np.array([[1.0, 2.0, 3.0]]))
    assert resampled(np.array([[2.0]]), "linear", 3, "linear") == pytest.approx(np.full((1, 3), 2.0))


def test_another_grid_and_another_interpolation(cart: Problem, found: Solution) -> None:
    """The run's own problem says how its knots are joined, with its settings."""
    made, notes = taken(cart.set({"push.knots": 10, "push.interpolation": "constant"}), found)
    value = found.value["push"][:, 0]
    assert notes == ()
    assert made.variables[0].guess[0] == pytest.approx(value[0] + (value[1] - value[0]) * 0.2)


def test_what_does_not_fit_is_said(cart: Problem, found: Solution) -> None:
    """A bound that clips, a name that is missing, another size; each names the variable."""
    made, (note,) = taken(cart.set({"push.upper": 1.0, "push.guess": 0.0}), found)
    assert made.variables[0].guess.max() == 1.0
    assert note.startswith("push: ") and note.endswith("of 5 numbers are clipped to the bounds")
    more = '[[variable]]\nname = "load"\nsets = "cart.mass"\nlower = 0.5\n'
    problem = symphys.load(tomllib.loads(CART + more))
    made, (note,) = taken(problem, found)
    assert note == "load: the run has no variable of this name; its guess is the problem's"
    assert made.variables[1].guess == problem.variables[1].guess
    other = replace(cart, variables=(replace(cart.variables[0], name="shove"),))
    assert taken(other, found)[0].guess is not None  # the motion fits
    values = {"push": np.zeros((2, 5))}
    wrong = replace(read_guess_run(found.folder), values=values)
    assert with_guess(cart, wrong)[1].notes == (
        "push: 2 x 5 numbers in the run, 1 x 5 here (components x knots); its guess is the problem's",
    )


def test_nothing_that_fits_is_an_error(cart: Problem, found: Solution, tmp_path: Path) -> None:
    with pytest.raises(SymphysError, match=r"ball_throw: .*push.*throw, spin"):
        symphys.solve("ball_throw", "least_squares", backend="casadi", guess=found)
    with pytest.raises(SymphysError, match=r"no run folder.*multiple_shooting-seed0"):
        symphys.solve(cart, "gradient", guess=found.folder.parent)
    with pytest.raises(SymphysError, match="no run folder"):
        symphys.solve(cart, "gradient", guess=tmp_path / "nowhere")


def test_the_motion_is_the_guess_of_the_states(cart: Problem, found: Solution) -> None:
    """At the nodes of another step, and stretched to another duration, where rates are as much lower."""
    recorded = found.trajectory
    for settings, share in (({"simulation.dt": 0.025}, 1.0), ({"simulation.duration": 2.0}, 0.5)):
        problem = cart.set(settings)
        made, _ = taken(problem, found)
        shooting = transcribe(made, backend="casadi").shooting
        assert shooting.guessed_states is not None and shooting.staged is not None
        half = problem.simulation.steps // 2
        x = shooting.guessed_states(shooting.start(0), np.array([half]), 0.0)
        middle = len(recorded.time) // 2
        stages = shooting.staged()
        off = stages.difference(shooting.staged().start(shooting.start(0)[None]), x)[0]
        assert off[0] == pytest.approx(float(recorded["rail.position"][middle]), abs=1e-9)
        assert off[1] == pytest.approx(share * float(recorded["rail.rate"][middle]), abs=1e-9)


@few("solver", [name for name, each in SOLVERS.items() if each.scenarios is not True], 2)
def test_every_solver_starts_there(solver: str, cart: Problem, found: Solution, tmp_path: Path) -> None:
    """The first row of its trace is the solution of the run; on another grid it is as good as its control is."""
    budgets = {"evolution": {"generations": 1}, "cma": {"evaluations": 20}, "race": {"rounds": 0}}
    few = budgets.get(solver, {"iterations": 1})
    again = symphys.solve(cart, solver, backend="casadi", folder=tmp_path, guess=found, **few)
    assert again.run.guess["objective"] == pytest.approx(found.objective, rel=1e-9)
    assert again.folder.parent.name.startswith("cart@solver.") and ",guess=" in again.folder.parent.name
    assert again.run.provenance["guess"] == str(found.folder)


def test_the_page_says_where_it_starts(cart: Problem, found: Solution, tmp_path: Path) -> None:
    """And says nothing of the kind where the guess is the file's."""
    again = symphys.solve(cart, "gradient", backend="casadi", folder=tmp_path, guess=found, iterations=1)
    for solution, told in ((again, True), (found, False)):
        page = write_run_report(solution.folder).read_text(encoding="utf-8")
        assert (f"Initial guess: the result of {found.folder}" in page) == told


@pytest.mark.slow
def test_multipliers_are_kept_and_taken(cart: Problem, found: Solution, tmp_path: Path) -> None:
    """A second solve from a finished run takes no iteration, and without the multipliers it takes some."""
    assert (found.folder / MULTIPLIERS).exists()
    assert found.run.iterations > 3
    limited = cart.set({"push.upper": 5.0, "push.lower": -5.0})
    first = symphys.solve(limited, "multiple_shooting", backend="casadi", folder=tmp_path)
    again = symphys.solve(limited, "multiple_shooting", backend="casadi", folder=tmp_path, guess=first)
    assert "multipliers of the guess: taken" in (again.folder / LOG).read_text()
    (first.folder / MULTIPLIERS).unlink()
    without = symphys.solve(limited, "multiple_shooting", backend="casadi", folder=tmp_path, guess=first.folder)
    assert again.run.iterations < without.run.iterations <= first.run.iterations
    assert again.objective == pytest.approx(first.objective, rel=1e-4)
    assert without.folder != again.folder


def test_another_guess_is_another_run(cart: Problem, found: Solution, tmp_path: Path) -> None:
    """Its key and its folder follow from what was taken, not from where it lies; a run never overwrites its guess."""
    guess = read_guess_run(found.folder)
    moved = tmp_path / "moved"
    moved.mkdir()
    for path in found.folder.iterdir():
        if path.is_file():
            (moved / path.name).write_bytes(path.read_bytes())
    (plain,), (one,), (same,) = (
        make_jobs([cart], ["gradient"], [0], {}, tmp_path, guess=each) for each in (None, guess, read_guess_run(moved))
    )
    assert one.config.key == same.config.key != plain.config.key and one.folder == same.folder != plain.folder
    (moved / TRAJECTORY).unlink()
    (other,) = make_jobs([cart], ["gradient"], [0], {}, tmp_path, guess=read_guess_run(moved))
    assert other.config.key != one.config.key and other.folder != one.folder
    assert make_jobs([cart], ["gradient"], [0], {"a": 1}, tmp_path, guess=guess)[0].case.endswith(f",{one.guess.word}")
