"""The shipped problems are valid and are found by name."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import pytest
from tools.repeats import few

from symphys import problems
from symphys.cli import main
from symphys.errors import SymphysError
from symphys.problem import load_problem

SHIPPED = [
    "acrobot",
    "air_hockey",
    "ant_walk",
    "arm_ball",
    "arm_reach",
    "ball_throw",
    "bank_shot",
    "basket",
    "bounce_cycle",
    "bounce_recorded",
    "bowling",
    "cart_double_pendulum",
    "cart_pole",
    "cart_pole_walls",
    "catch",
    "cost_of_transport",
    "crane",
    "dismount",
    "door",
    "dribble",
    "eddy_brake",
    "fast_tray",
    "fastest_move",
    "follow_swing",
    "free_kick",
    "gait_robot_build",
    "gait_robot_fast",
    "gait_robot_trot",
    "half_cheetah_run",
    "hopper_gait",
    "hopper_jump",
    "hopper_run",
    "ice_and_asphalt",
    "juggle",
    "kerb",
    "knock",
    "mini_cheetah_ahead",
    "mini_cheetah_mpc",
    "pancake",
    "parcel",
    "pendulum",
    "planar_hopper",
    "planar_hopper_mpc",
    "push_and_fly",
    "push_box",
    "putt",
    "quadrotor_slalom",
    "quadruped_shift",
    "quadruped_walk",
    "quadruped_walk_net",
    "row_of_balls",
    "sled",
    "somersault",
    "spinner",
    "squat_jump",
    "stairs",
    "table_tennis",
    "three_hops",
    "tip_over",
    "transport",
    "two_balls",
    "walker2d_walk",
]


def test_all_are_listed_here() -> None:
    assert list(problems.catalogue()) == SHIPPED


@few("name", SHIPPED, 16)
def test_shipped_problems_are_valid(name: str) -> None:
    problem = load_problem(problems.catalogue()[name])
    assert problem.name == name
    assert problem.title != name
    assert problem.description
    assert problem.variables
    assert problem.costs or problem.targets or problem.recordings
    assert problem.world().bodies


def test_the_reference_experiment() -> None:
    problem = load_problem(problems.find("ball_throw"))
    ball = problem.world().bodies[0]
    (pair,) = problem.world().pairs
    assert (ball.mass, ball.inertia, ball.shapes[0].radius) == (1, pytest.approx(0.1), 0.5)
    assert (pair.law.friction, pair.law.restitution) == (1, 0.5)
    assert (problem.simulation.dt, problem.simulation.steps) == (0.01, 500)
    assert problem.initial["ball.position"].tolist() == [0, 0, 1.5]
    assert sum(variable.guess.size for variable in problem.variables) == 6
    assert not any(variable.guess.any() for variable in problem.variables)
    assert [target.tolerance for target in problem.targets] == [0.01] * 3


def test_the_optimal_control_problem() -> None:
    problem = load_problem(problems.find("two_balls"))
    assert (problem.simulation.steps, problem.goal, problem.stop_when_met) == (480, 1.4, False)
    assert problem.variables[0].guess.tolist() == [3.0] * 960


@pytest.mark.parametrize("name", ["ball_throw", "ball_throw.toml"])
def test_found_by_name(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert problems.find(name) == problems.catalogue()["ball_throw"]


def test_a_path_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("ball_throw.toml").touch()
    assert problems.find("ball_throw.toml") == Path("ball_throw.toml")
    assert problems.find(tmp_path) == tmp_path


@pytest.mark.parametrize("name", ["ball_thro", "problems/ball_thro.toml", "Ball_Throw.toml"])
def test_the_nearest_name_is_offered(name: str) -> None:
    with pytest.raises(SymphysError, match='"ball_throw"'):
        problems.find(name)


@pytest.mark.parametrize("name", ["", "a\x00b", "a" * 5000, "nothing" + os.sep])
def test_names_that_cannot_be(name: str) -> None:
    with pytest.raises(SymphysError, match="no shipped problem"):
        problems.find(name)


def test_the_folder_is_no_package_of_its_own() -> None:
    file = Path(problems.__file__)
    spec = importlib.util.spec_from_file_location("problems", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.raises(ImportError, match=r"symphys\.problems"):
        spec.loader.exec_module(module)


def test_robots_are_listed_apart_from_problems(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    few = {name: problems.find(name) for name in ("ball_throw", "cart_pole")}
    monkeypatch.setattr(problems, "catalogue", lambda: few)
    assert main(["list"]) == 0
    listed = capsys.readouterr().out.split("robots and tasks, for [[include]]:")
    assert "cart_pole" in listed[0]
    assert "robots/" not in listed[0]
    assert "robots/table_robot.toml" in listed[1] and "tasks/walk_ahead.toml" in listed[1]
    with pytest.raises(SymphysError, match="no shipped problem"):
        problems.find("table_robot")
