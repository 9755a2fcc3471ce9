"""Sensors and controllers along a rollout: what they read, what they give, derivatives through both."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few

from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem
from symphys.transcription import Transcription, transcribe
from symphys.types import Array
from symphys.verification.sensitivity_growth import sensitivity_growth

CART = """
[simulation]
duration = 0.6
dt = 0.01

[[body]]
name = "cart"
shape = { box = { size = [0.3, 0.2, 0.1] } }
mass = 1.0

[[body]]
name = "pole"
shape = { sphere = { radius = 0.05 } }
mass = 0.3
position = [0.05, 0, 0.5]

[[joint]]
name = "rail"
between = ["world", "cart"]
slider = { axis = [1, 0, 0] }
motor = { torque = { torque = 30 } }

[[joint]]
name = "pivot"
between = ["cart", "pole"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0]

[[sensor]]
name = "state"
reads = ["rail.position", "rail.rate", "pivot.angle", "pivot.rate"]

[[sensor]]
name = "imu"
reads = ["pole.accelerometer", "pole.gyro", "rail.command", "pole.orientation", "rail.torque"]

[[controller]]
name = "balance"
drives = "rail.command"
senses = ["state", "imu"]
scale = 2.0
linear = { gains = [[1, 2, 40, 10, 0.1, 0, 0.01, 0, 0.2, 0, 0.1, 0, 0, 1, 0, 0.01]], offsets = 0.3 }

[[controller]]
name = "brain"
drives = "rail.command"
senses = ["state"]
net = { hidden = [5, 3], skip = true }

[[controller]]
name = "shake"
drives = "rail.command"
periodic = { frequency = 2.0, harmonics = 2, sines = [0.5, 0.1] }

[[variable]]
name = "gains"
sets = "balance.gains"

[[variable]]
name = "weights"
sets = "brain.weights"

[[variable]]
name = "frequency"
sets = "shake.frequency"

[[variable]]
name = "knots"
sets = "rail.command"
knots = 3

[[cost]]
name = "upright"
at = "always"
squares = "[pivot.angle, rail.position, 0.01 * rail.command, 0.001 * pole.accelerometer]"
"""


def problem_of(folder: Path, text: str = CART) -> Problem:
    """The problem of a text."""
    path = folder / "cart.toml"
    path.write_text(text)
    return load_problem(path)


def points(made: Transcription) -> Array:
    """(3, n) near the guess."""
    start = made.shooting.start(0)
    return start + 0.05 * np.random.default_rng(3).standard_normal((3, start.size))


def test_all_controllers_add_up(tmp_path: Path) -> None:
    """The command of every step is what numpy makes of the recorded states and the step before."""
    problem = problem_of(tmp_path)
    made = transcribe(problem, backend="casadi")
    z = points(made)[0]
    record = made.record(z)
    course, motion, blocks = record.arrays, record.motion, made.shooting.by_block(z)
    angle, place = motion.joint_value[:, 1, 0], motion.joint_value[:, 0, 0]
    state = np.stack([place, motion.joint_rate[:, 0, 0], angle, motion.joint_rate[:, 1, 0]], axis=1)
    knots = np.repeat(blocks["knots"].ravel(), 20)
    layers = blocks["weights"].ravel()
    k = 17
    hidden = np.tanh(layers[:20].reshape(5, 4) @ state[k] + layers[20:25])
    hidden = np.tanh(layers[25:40].reshape(3, 5) @ hidden + layers[40:43])
    net = layers[43:46] @ hidden + layers[46] + layers[47:] @ state[k]
    phase = 2 * np.pi * blocks["frequency"].item() * 0.01 * k
    shake = 0.5 * np.sin(phase) + 0.1 * np.sin(2 * phase)
    velocity, spin, q = motion.velocity[:, 1], motion.angular_velocity[:, 1], motion.orientation[:, 1]
    w, x, y, zq = q[k]
    turned = np.array(
        [
            [1 - 2 * (y * y + zq * zq), 2 * (x * y - w * zq), 2 * (x * zq + w * y)],
            [2 * (x * y + w * zq), 1 - 2 * (x * x + zq * zq), 2 * (y * zq - w * x)],
            [2 * (x * zq - w * y), 2 * (y * zq + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    felt = turned.T @ ((velocity[k] - velocity[k - 1]) / 0.01 + [0, 0, 9.81])
    torque = motion.joint_torque[k - 1, 0]
    imu = np.concatenate([felt, turned.T @ spin[k], course.u[k - 1], q[k], torque[:1]])
    linear = 2.0 * (blocks["gains"].ravel() @ np.concatenate([state[k], imu]) + 0.3)
    assert course.u[k, 0] == pytest.approx(knots[k] + net + shake + linear, rel=1e-9)


@pytest.mark.slow
def test_trust_sees_the_loop(tmp_path: Path) -> None:
    """Growth is that of the controlled robot: feedback that holds the pole up keeps it small."""
    wild = CART.replace("40, 10,", "0, 0,")
    held, free = (
        sensitivity_growth(made, made.record(made.shooting.start(0)))
        for made in (
            transcribe(problem_of(tmp_path, text.replace("0.6", "2.0")), backend="casadi") for text in (CART, wild)
        )
    )
    assert held["factor"][0] < 0.1 * free["factor"][0]


FALLING = """
[simulation]
duration = 0.4
dt = 0.01

[[body]]
name = "crate"
shape = { sphere = { radius = 0.1 } }
mass = 2.0
position = [0, 0, 0.1]
orientation = { yaw_deg = 90 }

[[body]]
name = "stone"
shape = { sphere = { radius = 0.1 } }
mass = 2.0
position = [3, 0, 9]
angular_velocity = [0, 1, 0]
orientation = { yaw_deg = 90 }

[ground]
friction = 0.5

[[variable]]
name = "nothing"
sets = "stone.velocity"

[[cost]]
name = "felt"
value = "VALUE"
"""


@few(
    ("value", "expected"),
    [
        ("crate.accelerometer[2]", 9.81),
        ("norm(crate.accelerometer[0:2])", 0.0),
        ("norm(stone.accelerometer)", 0.0),
        ("crate.contact_force[2]", 2 * 9.81),
        ("norm(stone.contact_force)", 0.0),
        ("stone.gyro[0]", 1.0),
    ],
    2,
)
def test_what_bodies_feel(tmp_path: Path, value: str, expected: float) -> None:
    """At rest gravity is felt, in free fall nothing; turning is felt in the body's frame."""
    made = transcribe(problem_of(tmp_path, FALLING.replace("VALUE", value)), backend="casadi")
    assert made.judge(made.shooting.start(0)).objective == pytest.approx(expected, abs=1e-9)


GIVEN = (
    CART.split("[[controller]]")[0]
    + """
[[controller]]
name = "own"
drives = "rail.command"
senses = ["state"]
function = { weights = [40, 10] }

[[variable]]
name = "w"
sets = "own.weights"

[[cost]]
name = "upright"
at = "always"
squares = "pivot.angle"
"""
)


@pytest.mark.slow
def test_function_from_python(tmp_path: Path) -> None:
    """A casadi function does what the same gains do as a linear controller."""
    path = tmp_path / "given.toml"
    path.write_text(GIVEN)
    o, t, w = ca.SX.sym("o", 4), ca.SX.sym("t"), ca.SX.sym("w", 2)
    function = ca.Function("own", [o, t, w], [w[0] * o[2] + w[1] * o[3]])
    own = transcribe(load_problem(path, functions={"own": function}), backend="simd")
    path.write_text(
        GIVEN.replace("function = { weights = [40, 10] }", "linear = { gains = [[0, 0, 40, 10]] }").replace(
            '"own.weights"', '"own.gains[2:4]"'
        )
    )
    linear = transcribe(load_problem(path), backend="simd")
    a, b = (made.shooting.evaluator.gradient(made.shooting.start(0)[None], 0.0) for made in (own, linear))
    assert a.merit == pytest.approx(b.merit, rel=1e-12)
    assert a.gradient is not None and b.gradient is not None
    assert np.allclose(a.gradient, b.gradient, rtol=1e-9)


def test_function_that_nobody_gives(tmp_path: Path) -> None:
    """The command line cannot give one; the message says how Python does."""
    with pytest.raises(ProblemError, match="load_problem"):
        problem_of(tmp_path, GIVEN)


def test_records_hold_what_controllers_tell_motors(tmp_path: Path) -> None:
    """A torque motor gives what it is told, by all controllers and the variable together."""
    made = transcribe(problem_of(tmp_path), backend="casadi")
    motion = made.simulate(points(made)[0])
    told = motion.joint_command[:, 0, 0]
    assert np.ptp(told) > 1
    assert motion.joint_torque[:, 0, 0] == pytest.approx(np.clip(told, -30, 30))
