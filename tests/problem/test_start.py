"""Joints that start elsewhere than at 0: where bodies then are, how they move, and what cannot be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from worlds.joint_texts import HINGE, SLIDER, UNIVERSAL, body, joint

from symphys.dynamics.observation.joint_coordinates import Reading, readings
from symphys.errors import ProblemError
from symphys.model.state_layout import initial_state
from symphys.problem import Problem
from symphys.types import Array

Load = Callable[..., Problem]
Refused = Callable[..., ProblemError]
Names = Callable[[ProblemError, str, str], None]

LINKS = body("torso", 1.5) + body("thigh", 0.75) + body("shin", 0.25)
TIME = "[simulation]\nduration = 1.0\ndt = 0.01\n"
HIP, KNEE = joint("hip", "torso thigh", 1, "start = 0.4"), joint("knee", "thigh shin", 0.5, "start_deg = -60")
LEG = TIME + LINKS + HIP + KNEE
"""A torso, a thigh and a shin, half a metre each, straight down in the file."""


def read(problem: Problem) -> dict[str, Reading]:
    world = problem.world()
    return readings(world, initial_state(world, problem.initial))


def number(value: Any) -> Array:
    return np.array(ca.evalf(ca.SX(value))).ravel()


def held(reading: Reading, value: list[float], rate: list[float]) -> None:
    assert number(reading.value) == pytest.approx(value, abs=1e-12)
    assert number(reading.rate) == pytest.approx(rate, abs=1e-12)
    assert number(reading.separation) == pytest.approx(0, abs=1e-12)
    assert number(reading.tilt) == pytest.approx(0, abs=1e-12)


def test_a_bent_leg(load: Load) -> None:
    """Knee and foot are where trigonometry has them; a positive angle about y moves what hangs backwards."""
    initial = load(text=LEG).initial
    lower = 0.4 - np.pi / 3
    knee = np.array([-0.5 * np.sin(0.4), 0, 1 - 0.5 * np.cos(0.4)])
    assert initial["torso.position"].tolist() == [0, 0, 1.5]
    assert initial["thigh.position"] == pytest.approx([-0.25 * np.sin(0.4), 0, 1 - 0.25 * np.cos(0.4)])
    assert initial["shin.position"] == pytest.approx(knee - 0.25 * np.array([np.sin(lower), 0, np.cos(lower)]))
    turn = Rotation.from_quat(initial["shin.orientation"], scalar_first=True).as_rotvec()
    assert turn == pytest.approx([0, lower, 0])


@pytest.mark.parametrize("hip", ["torso thigh", "thigh torso"])
@pytest.mark.parametrize("knee", ["thigh shin", "shin thigh"])
@pytest.mark.parametrize("rail", ["", joint("rail", "world shin", 0, "start = 0.2", SLIDER)])
def test_coordinates_are_what_start_says(load: Load, hip: str, knee: str, rail: str) -> None:
    """Whichever of the two is second in the table, and whichever end the world holds."""
    text = TIME + LINKS + joint("hip", hip, 1, "start = 0.4") + joint("knee", knee, 0.5, "start = -1") + rail
    problem = load(text=text)
    found = read(problem)
    held(found["hip"], [0.4], [0])
    held(found["knee"], [-1], [0])
    if rail:
        held(found["rail"], [0.2], [0])
        assert problem.initial["shin.position"] == pytest.approx([0.2, 0, 0.25])


def test_a_universal_joint_has_two(load: Load) -> None:
    text = TIME + LINKS + joint("hip", "torso thigh", 1, "start = [0.4, -0.3]", UNIVERSAL)
    held(read(load(text=text))["hip"], [0.4, -0.3], [0, 0])
    other = TIME + LINKS + joint("hip", "thigh torso", 1, "start_deg = [20, 30]", UNIVERSAL)
    other += joint("floor", "world thigh", 0, "", "fixed = {}")
    found = read(load(text=other))
    held(found["hip"], [np.pi / 9, np.pi / 6], [0, 0])


def test_velocities_are_carried(load: Load) -> None:
    """Thrown and spinning as a whole, with the knee turning at 3 rad/s: rates and the whole's motion stay."""
    spin, throw = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, 3.0])
    links = ""
    for name, z in (("torso", 1.5), ("thigh", 0.75), ("shin", 0.25)):
        turning = 3.0 * (name == "shin")
        own = spin + np.array([0, turning, 0])
        speed = throw + np.cross(spin, [0, 0, z]) + np.cross([0, turning, 0], [0, 0, -0.25])
        links += body(name, z, f"velocity = {speed.tolist()}\nangular_velocity = {own.tolist()}")
    initial = (problem := load(text=TIME + links + HIP + KNEE)).initial
    held(read(problem)["hip"], [0.4], [0])
    held(read(problem)["knee"], [-np.pi / 3], [3])
    assert initial["thigh.velocity"] == pytest.approx(throw + np.cross(spin, initial["thigh.position"]))
    assert initial["thigh.angular_velocity"] == pytest.approx(spin)


def test_without_a_start_nothing_moves(load: Load) -> None:
    plain = TIME + LINKS + joint("hip", "torso thigh", 1) + joint("knee", "thigh shin", 0.5)
    zero = TIME + LINKS + joint("hip", "torso thigh", 1, "start = 0") + joint("knee", "thigh shin", 0.5)
    for name, value in load(text=plain).initial.items():
        assert load(text=zero).initial[name].tolist() == value.tolist()


def test_the_start_is_what_must_be_within_limits_and_clear_of_the_ground(load: Load, refused: Refused) -> None:
    """Straight, the leg reaches 1 cm into the ground and the knee beyond its limits; bent, neither."""
    foot = "shape = { spheres = [{ radius = 0.01, centre = [0, 0, -0.25] }] }"
    text = LEG.replace(body("shin", 0.25), body("shin", 0.25, foot)) + "[ground]\n"
    assert load(("start_deg = -60", "start_deg = -60\nlimits_deg = [-90, -10]"), text=text)
    error = refused(("start_deg = -60", ""), ("start = 0.4", ""), text=text)
    assert "sinks into ground by 0.01 m" in str(error)


CASES = [
    ("start = 0.4", "start = 0.4\nlimits = [-1, 0.3]", 'joint "hip".start', "0.4 is beyond the limits of this joint"),
    ("start = 0.4", "start_deg = 40\nlimits_deg = [-9, 9]", 'joint "hip".start_deg', "40 is beyond the limits"),
    ("start = 0.4", "start = [1, 2]", 'joint "hip".start', "a hinge has 1 coordinate, but 2 are given"),
    ("start = 0.4", "start = []", 'joint "hip".start', "a number, or a list with one for each"),
    ("start = 0.4", "start = [[1]]", 'joint "hip".start', "a number, or a list with one for each"),
    ("start = 0.4", "start = nan", 'joint "hip".start', "a number, or a list with one for each coordinate, not nan"),
    ("start = 0.4", "start = 1\nstart_deg = 1", 'joint "hip".start_deg', "start is given too"),
    (f"{HINGE}\npoint = [0, 0, 1]", "fixed = {}", 'joint "hip".start', "a fixed joint has no coordinate"),
    (
        f"{HINGE}\npoint = [0, 0, 0.5]",
        "ball = {}\npoint = [0, 0, 0.5]",
        'joint "knee".start_deg',
        "a ball joint has no",
    ),
    (f"{HINGE}\npoint = [0, 0, 0.5]", SLIDER, 'joint "knee".start_deg', "a slider has no angle; give start"),
    (f"{HINGE}\npoint = [0, 0, 1]", UNIVERSAL + "\npoint = [0, 0, 1]", 'joint "hip".start', "2 coordinates, but 1 are"),
    ("start = 0.4", "start = 0.4\nfrequency = 3", 'joint "hip".start', "this joint gives way, so it begins where"),
    (KNEE, KNEE + joint("tie", "torso shin", 0, "start = 1"), 'joint "tie".start', "this joint closes a loop"),
    (
        KNEE,
        KNEE + joint("tie", "torso shin", 0),
        'joint "tie".between',
        "the start of other joints, or the guess of a variable puts torso and shin",
    ),
]


@pytest.mark.parametrize(("old", "new", "where", "message"), CASES)
def test_faults_are_named(refused: Refused, names: Names, old: str, new: str, where: str, message: str) -> None:
    names(refused((old, new), text=LEG), where, message)
