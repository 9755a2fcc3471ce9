"""The shipped robots: what they are made of, that they are even on both sides, and that they stand on the ground."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from tools.repeats import thorough

from symphys import problems
from symphys.dynamics.functions import step_function
from symphys.dynamics.observation import gap_function, reading_function
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Scheme
from symphys.problem import Problem, load_problem
from symphys.types import Array

Robot = Callable[..., Problem]
Simulated = Callable[[str, dict[str, float]], Array]
QUICK = ("arm", "cart_pendulum", "hopper")
ROBOTS = ["arm", "cart_pendulum", "gait_robot", "hopper", "mini_cheetah", "quadrotor", "table_robot"]
LEGS = ("fl", "fr", "hl", "hr")
SECONDS, DT = 1.0, 0.01


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Loads a robot in a tiny problem, each once."""
    found: dict[tuple[str, str], Problem] = {}

    def robot(name: str, ground: str = "[ground]") -> Problem:
        if (name, ground) not in found:
            path = tmp_path_factory.mktemp(name) / "tiny.toml"
            include = f'[[include]]\nfile = "robots/{name}.toml"\n'
            path.write_text(f"[simulation]\nduration = {SECONDS}\ndt = {DT}\n{include}{ground}\n", encoding="utf-8")
            found[name, ground] = load_problem(path)
        return found[name, ground]

    return robot


@pytest.fixture(scope="module")
def simulated(robot: Robot) -> Simulated:
    """A second of a robot on the ground: (100, nx) states after each step; joints that are not named are told 0.

    Steps are not cut at impacts: what rests or lands on soft knees needs no exact bounces.
    """
    steps: dict[str, ca.Function] = {}

    def simulated(name: str, commands: dict[str, float]) -> Array:
        world = robot(name).world()
        inputs = [f"{joint.name}.command" for joint in world.joints if joint.driven]
        if name not in steps:
            steps[name] = step_function(world, Scheme(dt=DT, sweeps=20, cuts=0), inputs)
        u = [commands.get(command.removesuffix(".command"), 0.0) for command in inputs]
        x, states = initial_state(world, robot(name).initial), []
        for _ in range(round(SECONDS / DT)):
            x = steps[name](x, u, [], 0)
            states.append(np.array(x).ravel())
        return np.array(states)

    return simulated


def mass(problem: Problem) -> float:
    return sum(float(body.mass) for body in problem.world().bodies)


def test_all_are_listed_here() -> None:
    robots = [file for file in problems.parts() if file.startswith("robots/")]
    assert robots == [f"robots/{name}.toml" for name in ROBOTS]
    assert not {Path(file).stem for file in problems.parts()} & set(problems.catalogue())


@pytest.mark.parametrize(
    ("name", "bodies", "kinds", "servos", "kilograms"),
    [
        ("arm", 4, {"hinge": 4}, 4, 32),
        ("cart_pendulum", 2, {"slider": 1, "hinge": 1}, 0, 1.3),
        ("gait_robot", 9, {"hinge": 8}, 8, 28.69),
        ("hopper", 5, {"slider": 3, "hinge": 2}, 1, 6.2),
        ("mini_cheetah", 13, {"hinge": 12}, 12, 8.252),
        ("table_robot", 17, {"hinge": 16}, 16, 24.4),
    ],
)
def test_what_they_are_made_of(
    robot: Robot, name: str, bodies: int, kinds: dict[str, int], servos: int, kilograms: float
) -> None:
    world = robot(name).world()
    names = [joint.kind.name for joint in world.joints]
    assert len(world.bodies) == bodies
    assert {kind: names.count(kind) for kind in names} == kinds
    assert [type(joint.motor).__name__ for joint in world.joints].count("Servo") == servos
    assert mass(robot(name)) == pytest.approx(kilograms, abs=5e-3)


@pytest.mark.parametrize("name", ["gait_robot", "table_robot"])
def test_left_is_right_and_front_is_hind(robot: Robot, name: str) -> None:
    """Mirrored bodies have mirrored places and equal masses and inertias; mirrored joints equal motors and starts."""
    problem = robot(name)
    bodies = {body.name: body for body in problem.world().bodies}
    joints = {plan.name: plan for plan in problem.parametric.joints}
    for part in {body[3:] for body in bodies if body[:2] in LEGS}:
        places = [problem.initial[f"{leg}_{part}.position"] for leg in LEGS]
        assert places[0] == pytest.approx(places[1] * [1, -1, 1])
        assert places[2] == pytest.approx(places[3] * [1, -1, 1])
        assert (places[0] - places[2])[1:] == pytest.approx(0)
        four = [bodies[f"{leg}_{part}"] for leg in LEGS]
        assert len({(body.mass, body.inertia, body.shapes) for body in four}) == 1
    for part in {joint[3:] for joint in joints if joint[:2] in LEGS}:
        assert len({(joints[f"{leg}_{part}"].motor, joints[f"{leg}_{part}"].start) for leg in LEGS}) == 1
    centre = sum(body.mass * problem.initial[f"{body.name}.position"] for body in bodies.values()) / mass(problem)
    assert centre[1] == pytest.approx(0, abs=1e-12)


def test_the_table_robot_has_108_rows(robot: Robot) -> None:
    """Its feet alone touch: 16 hinges of 5 rows, 16 servos, 4 feet of 3."""
    world = robot("table_robot").world()
    assert [pair.name for pair in world.pairs] == [f"{leg}_lower-ground" for leg in LEGS]
    locked = sum(joint.locked for joint in world.joints)
    assert (locked, len([joint for joint in world.joints if joint.driven]), 3 * len(world.pairs)) == (80, 16, 12)
    for leg in LEGS:
        axes = [plan.frames[1].orientation for plan in robot("table_robot").parametric.joints if plan.name[:2] == leg]
        assert len(axes) == 4


def test_the_gait_robot_is_that_of_the_journal(robot: Robot) -> None:
    """Masses and inertias are those of boxes and spheres of 1000 kg/m^3 that are fixed to each other."""
    ball = 1000 * 4 / 3 * np.pi * 0.05**3
    bodies = {body.name: body for body in robot("gait_robot").world().bodies}
    corners = [(0.3 * a, 0.1 * b, 0.0) for a in (1, -1) for b in (1, -1)]
    check_inertia(bodies["spine"], [(21, (0.7, 0.3, 0.1), (0, 0, 0))], [(ball, c) for c in corners])
    centre = (0.375 * 0.125 + ball * 0.05) / (0.375 + ball)
    for leg in LEGS:
        tibia = (0.375, (0.05, 0.05, 0.15), (0, 0, 0.125 - centre))
        check_inertia(bodies[f"{leg}_tibia"], [tibia], [(ball, (0, 0, 0.05 - centre))])
        assert robot("gait_robot").initial[f"{leg}_tibia.position"][2] == pytest.approx(centre, abs=1e-7)
    motor = robot("gait_robot").parametric.joints[0].motor
    assert tuple(vars(motor).values()) == pytest.approx((50, 4, np.deg2rad(1440), np.deg2rad(45)))


def check_inertia(body: object, boxes: list[tuple[float, Array, Array]], balls: list[tuple[float, Array]]) -> None:
    """By the parallel axis theorem."""
    total, tensor = 0.0, np.zeros(3)
    parts = [(m, m / 12 * (np.dot(size, size) - np.square(size)), place) for m, size, place in boxes]
    parts += [(m, np.full(3, 0.4 * m * 0.05**2), place) for m, place in balls]
    for m, own, place in parts:
        total += m
        tensor += own + m * (np.dot(place, place) - np.square(place))
    assert body.mass == pytest.approx(total, rel=1e-6)
    assert body.inertia == pytest.approx(tensor, rel=1e-4)


@pytest.mark.parametrize(("ground", "friction"), [("[ground]", 0.5), ("[ground]\nfriction = 0.8", 0.4)])
def test_friction_of_the_gait_robot(robot: Robot, ground: str, friction: float) -> None:
    for pair in robot("gait_robot", ground).world().pairs:
        assert pair.law.friction == pytest.approx(friction)


@pytest.mark.parametrize(
    ("name", "feet"),
    [
        ("gait_robot", [f"{leg}_tibia-ground" for leg in LEGS]),
        ("hopper", ["foot-ground"]),
        ("mini_cheetah", [f"{leg}_shank-ground" for leg in LEGS]),
        ("table_robot", [f"{leg}_lower-ground" for leg in LEGS]),
    ],
)
def test_feet_touch_at_the_start(robot: Robot, name: str, feet: list[str]) -> None:
    world = robot(name).world()
    gaps = np.array(gap_function(world)(initial_state(world, robot(name).initial))).ravel()
    touching = [pair.name for pair, gap in zip(world.pairs, gaps, strict=True) if abs(gap) < 1e-6]
    assert touching == feet
    assert min(gaps) > -1e-6


def test_the_table_robot_starts_with_bent_legs(robot: Robot) -> None:
    """Knees behind shoulders, feet below them."""
    initial = robot("table_robot").initial
    for leg in LEGS:
        shoulder, upper = initial[f"{leg}_bracket.position"], initial[f"{leg}_upper.position"]
        knee = 2 * upper - shoulder
        foot = 2 * initial[f"{leg}_lower.position"] - knee
        assert knee[0] < shoulder[0] - 0.1
        assert foot == pytest.approx([*shoulder[:2], 0.05], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name if name in QUICK else thorough(name) for name in ROBOTS if name != "quadrotor"])
def test_none_falls_through_the_ground_or_apart(robot: Robot, simulated: Simulated, name: str) -> None:
    """At commands of 0, which stretch bent legs at once; joints stay together to a millimetre."""
    world = robot(name).world()
    gaps, apart = gap_function(world), reading_function(world)
    states = simulated(name, {}).T
    assert np.isfinite(states).all()
    assert np.array(gaps.map(states.shape[1])(states)).min(initial=0) > -1e-3
    assert np.array(apart.map(states.shape[1])(states, [])[3]).max() < 1e-3


STANDING = {
    "arm": ("hand", {}),
    "cart_pendulum": ("pole", {}),
    "gait_robot": ("spine", {}),
    "mini_cheetah": (
        "body",
        {f"{leg}_{joint}": np.rad2deg(angle) for leg in LEGS for joint, angle in (("hip", -0.8), ("knee", 1.6))},
    ),
    "table_robot": (
        "torso",
        {f"{leg}_{joint}": angle for leg in LEGS for joint, angle in (("pitch", 25), ("elbow", -50))},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STANDING)
def test_they_stand_still_where_they_start(robot: Robot, simulated: Simulated, name: str) -> None:
    """Told to keep the angles of the start; they creep by some mm/s, as sweeps have not converged."""
    body, degrees = STANDING[name]
    problem = robot(name)
    last = simulated(name, {joint: float(np.deg2rad(angle)) for joint, angle in degrees.items()})[-1]
    layout = Layout(problem.world())
    assert last[layout[f"{body}.position"]] == pytest.approx(problem.initial[f"{body}.position"], abs=5e-3)
    assert np.abs(last[layout[f"{body}.velocity"]]).max() < 0.02


@pytest.mark.slow
def test_the_hopper_stands_on_its_spring_in_its_plane(robot: Robot, simulated: Simulated) -> None:
    """It swings by little about where the spring bears 5.6 kg, and stays in the plane y = 0."""
    layout = Layout(robot("hopper").world())
    torso = simulated("hopper", {})[:, layout["torso.position"]]
    assert np.abs(torso[:, 1]).max() < 1e-9
    assert np.ptp(torso[:, 2]) < 0.01
    sag = 0.7 - (torso[:, 2].min() + torso[:, 2].max()) / 2
    assert sag == pytest.approx(5.6 * 9.81 / 1000, rel=0.15)
