"""What formulas and records see of joints agrees with the motion of the bodies; commands and parameters act."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from symphys.problem import load_problem
from symphys.transcription import Transcription, transcribe

Make = Callable[..., Transcription]

PENDULUM = """
[simulation]
duration = 0.8
dt = 0.01

[[body]]
name = "rod"
shape = { capsule = { radius = 0.02, length = 0.5 } }
mass = 1.0
position = [0.2, 0, -0.2]
orientation = { pitch_deg = -45 }

[[joint]]
name = "pivot"
between = ["world", "rod"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0]
motor = { servo = { gain = 10, torque = 2, velocity = 5 } }
spring = { stiffness = 0.5, damping = 0.05, rest = 0.1 }

[[variable]]
name = "aim"
sets = "pivot.command"
knots = 4
guess = [0.3, 0.5, -0.2, 0.1]

[[variable]]
name = "made"
sets = ["pivot.stiffness"]
guess = 0.7

[[target]]
name = "ends"
value = "[pivot.angle, pivot.rate]"
tolerance = 0.01
weight = 3

[[cost]]
name = "torque"
at = "always"
squares = "pivot.torque"
weight = 0.01

[[cost]]
name = "command"
at = "always"
squares = "pivot.command"
weight = 0.1
"""

CROSS = """
[simulation]
duration = 0.5
dt = 0.01

[world]
gravity = [0, 0, 0]

[[body]]
name = "base"
inertia = [0.2, 0.3, 0.4]
mass = 3.0
position = [0, 0, 1]
angular_velocity = [0.3, -0.2, 0.5]

[[body]]
name = "tool"
inertia = [0.02, 0.03, 0.04]
mass = 1.0
position = [0, 0, 0.5]

[[joint]]
name = "wrist"
between = ["base", "tool"]
universal = { axes = [[0, 1, 0], [1, 0, 0]] }
point = [0, 0, 0.7]
motor = { servo = { gain = 8, torque = 5, velocity = 4 } }

[[variable]]
name = "push"
sets = "base.force[0]"
guess = 2.0

[[variable]]
name = "aim"
sets = "wrist.command"
guess = [[0.6, -0.4], [0.2, 0.5]]
knots = 2

[[target]]
name = "ends"
value = "[wrist.angle, wrist.rate]"
tolerance = 0.01
"""


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """A transcription of a text."""

    def build(text: str, backend: str = "casadi") -> Transcription:
        file = tmp_path / "jointed.toml"
        file.write_text(text, encoding="utf-8")
        return transcribe(load_problem(file), backend=backend, threads=1)

    return build


@pytest.mark.slow
def test_angle_and_rate_of_a_pendulum(make: Make) -> None:
    """Those of its orientation against the start, and of its angular velocity; the file's costs by hand."""
    made = make(PENDULUM)
    z = made.shooting.start(0)
    motion = made.simulate(z)
    turns = Rotation.from_quat(motion.orientation[:, 0], scalar_first=True)
    angle, rate = turns.as_rotvec()[:, 1] + np.pi / 4, motion.angular_velocity[:, 0, 1]
    assert np.ptp(angle) > 0.2
    assert motion.joint_names == ("pivot",)
    assert motion.joint_value[:, 0, 0] == pytest.approx(angle, abs=1e-9)
    assert motion.joint_rate[:, 0, 0] == pytest.approx(rate, abs=1e-9)
    verdict = made.judge(z)
    assert verdict.checks[0].error == pytest.approx(np.hypot(angle[-1], rate[-1]), abs=1e-9)
    torque = np.concatenate([[0.0], motion.joint_torque[:, 0, 0]])
    assert 0 < np.abs(torque).max() <= 2 + 1e-9
    assert motion.joint_command[:, 0, 0] == pytest.approx(np.repeat([0.3, 0.5, -0.2, 0.1], 20))
    assert verdict.costs["torque"] == pytest.approx(0.01 * np.trapezoid(torque**2, motion.time))
    assert verdict.costs["command"] == pytest.approx(0.1 * 0.2 * (0.09 + 0.25 + 0.04 + 0.01))


def test_the_rate_is_the_derivative_of_the_angle(make: Make) -> None:
    """Of both angles of a universal joint between two bodies that turn; differences over two steps."""
    made = make(CROSS)
    motion = made.simulate(made.shooting.start(0))
    value, rate = motion.joint_value[:, 0], motion.joint_rate[:, 0]
    assert value.shape == (51, 2)
    slope = (value[2:] - value[:-2]) / 0.02
    smooth = np.abs(np.diff(rate, 2, axis=0)) < 0.02
    assert smooth.mean() > 0.7
    assert rate[1:-1][smooth] == pytest.approx(slope[smooth], abs=0.02)
    assert np.abs(rate).max() > 1
    assert motion.joint_separation.shape == (51, 1)
    assert motion.joint_separation.max() < 1e-4


def test_a_motor_that_no_variable_commands_is_told_0(make: Make) -> None:
    start, end = PENDULUM.index('[[variable]]\nname = "aim"'), PENDULUM.index('[[variable]]\nname = "made"')
    motion = make(PENDULUM[:start] + PENDULUM[end:].replace('squares = "pivot.command"', 'squares = "pivot.rate"'))
    assert motion.simulate(motion.shooting.start(0)).joint_command[:, 0, 0] == pytest.approx(np.zeros(80))


def test_a_record_without_joints_says_so(make: Make) -> None:
    start = PENDULUM.index("[[joint]]")
    text = PENDULUM[:start] + '[[variable]]\nname = "throw"\nsets = "rod.velocity"\n'
    motion = make(text).simulate(np.zeros(3))
    assert motion.joint_names == ()
    assert motion.joint_value.shape == motion.joint_rate.shape == (81, 0, 0)
    assert motion.joint_torque.shape == motion.joint_command.shape == (80, 0, 0)
    assert motion.joint_separation.shape == (81, 0)


def test_a_linear_command_is_that_of_its_time(make: Make) -> None:
    """A force that grows from 0 to 10 N moves 1 kg by 10 / 6 m in a second; half a step of delay would cost 25 mm."""
    text = """
[simulation]
duration = 1.0
dt = 0.01

[[body]]
name = "cart"
mass = 1.0
inertia = 0.1

[[joint]]
name = "rail"
between = ["world", "cart"]
slider = { axis = [1, 0, 0] }
motor = { torque = { torque = 50 } }

[[variable]]
name = "push"
sets = "rail.command"
knots = 2
interpolation = "linear"
guess = [0, 10]
"""
    made = make(text)
    motion = made.simulate(made.shooting.start(0))
    assert motion.joint_value[-1, 0, 0] == pytest.approx(10 / 6, abs=2e-4)
    assert motion.joint_rate[-1, 0, 0] == pytest.approx(5, abs=2e-3)
