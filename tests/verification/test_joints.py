"""Energy and momentum add up where joints hold bodies: motors and springs work, locks do not, limits only take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from symphys.model.state_layout import Layout
from symphys.transcription import Record, Transcription
from symphys.verification.balance import balance, quick_moves

Make = Callable[..., Transcription]

PENDULUM = """
[simulation]
duration = 1.0
dt = 0.01

[[body]]
name = "rod"
inertia = [0.02, 0.02, 0.001]
mass = 1.0
position = [0, 0, -0.25]

[[joint]]
name = "pivot"
between = ["world", "rod"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0]
motor = { torque = { torque = 5 } }
spring = { stiffness = 2, damping = 0.05, rest = 0.1 }

[[variable]]
name = "push"
sets = "pivot.command"
knots = 5
interpolation = "linear"
guess = [0, 1, -1, 2, 0]

[[target]]
name = "t"
value = "pivot.angle"
tolerance = 0.1
"""

PAIR = """
[simulation]
duration = 0.5
dt = 0.01

[[body]]
name = "a"
inertia = [0.2, 0.3, 0.4]
mass = 3.0

[[body]]
name = "b"
inertia = [0.02, 0.03, 0.04]
mass = 1.0
position = [0, 0, -0.5]

[[joint]]
name = "wrist"
between = ["a", "b"]
universal = { axes = [[0, 1, 0], [1, 0, 0]] }
point = [0, 0, -0.3]
motor = { servo = { gain = 8, torque = 5, velocity = 4 } }

[[variable]]
name = "push"
sets = "a.force"
guess = [2, 1, 0]

[[variable]]
name = "aim"
sets = "wrist.command"
guess = [0.6, -0.4]

[[target]]
name = "t"
value = "wrist.angle"
tolerance = 0.1
"""


CROUCH = """
[simulation]
duration = 0.5
dt = 0.01
cuts = 2

[[body]]
name = "hip"
shape = { box = { size = [0.2, 0.2, 0.2] } }
mass = 5
position = [0, 0, 0.5]
collides_with = []

[[body]]
name = "foot"
shape = { sphere = { radius = 0.05 } }
mass = 0.5
position = [0, 0, 0.05]

[[joint]]
name = "mast"
between = ["world", "hip"]
slider = { axis = [0, 0, 1] }

[[joint]]
name = "leg"
between = ["hip", "foot"]
slider = { axis = [0, 0, -1] }
motor = { torque = { torque = 300 } }
spring = { stiffness = 500, damping = 5 }

[ground]

[[variable]]
name = "thrust"
sets = "leg.command"
knots = 6
interpolation = "linear"
guess = [40, 20, 20, 80, 120, 20]

[[target]]
name = "t"
value = "hip.position[2]"
tolerance = 0.1
"""

LIFT = """
[simulation]
duration = 2.0
dt = 0.01
cuts = 2
sweeps = 30

[[body]]
name = "tray"
shape = { box = { size = [0.4, 0.4, 0.1] } }
mass = 1.0
position = [0, 0, 1.0]

[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 0.4
position = [0, 0, 1.15]

[[joint]]
name = "lift"
between = ["world", "tray"]
slider = { axis = [0, 0, 1] }
motor = { affine = { gain = 100, kp = 100, kv = 20, offset = 13.734 } }

[[variable]]
name = "height"
sets = "lift.command"
knots = 5
interpolation = "linear"
guess = [0, -0.2, -0.4, -0.6, -0.6]

[[target]]
name = "t"
value = "lift.position"
tolerance = 1
"""


def found(made: Transcription) -> tuple[Record, dict[str, Any]]:
    record = made.record(made.shooting.start(0))
    return record, balance(made.rollout, record)


def gained(energy: dict[str, list[float]]) -> float:
    return energy["kinetic"][-1] + energy["potential"][-1] - energy["kinetic"][0] - energy["potential"][0]


def test_motors_and_springs_account_for_energy(make: Make) -> None:
    """Of the second order in a step; the work by hand is the integral of torque and rate."""
    drifts = []
    for dt in (0.01, 0.005):
        record, told = found(make(PENDULUM, simulation__dt=dt))
        motion, energy = record.motion, told["energy"]
        angle, rate = motion.joint_value[:, 0, 0], motion.joint_rate[:, 0, 0]
        spring = np.trapezoid((-2 * (angle - 0.1) - 0.05 * rate) * rate, motion.time)
        motor = np.sum(motion.joint_torque[:, 0, 0] * np.diff(angle))
        assert energy["applied"][-1] == pytest.approx(spring + motor, abs=0.01)
        assert gained(energy) == pytest.approx(energy["applied"][-1], abs=2e-3)
        assert abs(gained(energy)) > 0.1
        assert np.all(np.array(energy["contact"]) == 0)
        drifts.append(told["drift"] / max(energy["kinetic"]))
    assert drifts[0] < 2e-3
    assert drifts[1] < drifts[0] / 3


@pytest.mark.slow
def test_springs_and_motors_of_a_foot_on_the_ground_account_for_energy(make: Make) -> None:
    """Steps are cut there, and lags shorter: what its contact seems to add is little beside what the motor does."""
    told = found(make(CROUCH, simulation__dt=0.01))[1]
    assert max(told["energy"]["applied"]) > 5
    assert told["gained"] < 0.05


@pytest.mark.slow
def test_position_motors_account_for_energy_in_cut_steps(make: Make) -> None:
    """A tray with a ball on it is let down: its contact adds nothing."""
    told = found(make(LIFT))[1]
    assert told["energy"]["applied"][-1] < -8
    assert told["gained"] < 5e-4


def test_the_momentum_of_what_hangs_together_adds_up(make: Make) -> None:
    """A pair that nothing holds; forces of a motor and of what is locked cancel. What the world holds is left out."""
    assert found(make(PAIR))[1]["momentum"] < 1e-12
    assert found(make(PENDULUM))[1]["momentum"] == 0


def test_a_limit_takes_energy(make: Make) -> None:
    text = PENDULUM.replace("torque = { torque = 5 } }", "torque = { torque = 5 } }\nlimits = [-0.05, 0.05]")
    told = found(make(text))[1]
    assert told["energy"]["contact"][-1] < -1e-3
    assert told["gains"] == []
    assert told["drift"] < 1e-2 * max(told["energy"]["kinetic"])


SERVO, AFFINE = (
    PENDULUM.replace("motor = { torque = { torque = 5 } }", f"motor = {{ {motor} }}").replace("stiffness = 2, ", "")
    for motor in (
        "servo = { gain = 20, torque = 5, velocity = 8 }",
        "affine = { gain = 20, kp = 20, kv = 0.5, force_range = [-3, 3] }",
    )
)


@pytest.mark.parametrize("text", [SERVO, AFFINE], ids=["servo", "affine"])
def test_split_steps_record_all_that_a_motor_gives(make: Make, text: str) -> None:
    """Contacts of a body split its steps, far from all that it could touch too: inertia times acceleration is left."""
    text = "[world]\ngravity = [0, 0, 0]\n" + text
    feet = "shape = { spheres = [{ radius = 0.02, centre = [0, 0.1, 0] }, { radius = 0.02, centre = [0, -0.1, 0] }] }"
    ground = "[ground]\nheight = -9.0\n\n[[body]]\n" + feet
    split = text.replace("[[body]]", ground, 1)
    record, told = found(make(split))
    motion, rate = record.motion, record.motion.joint_rate[:, 0, 0]
    assert len(motion.contact_names) == 2
    assert told["drift"] < 1e-3 * max(told["energy"]["kinetic"])
    given = 0.0825 * np.diff(rate) / 0.01 + 0.05 * (rate[1:] + rate[:-1]) / 2
    print(told["drift"], max(told["energy"]["kinetic"]), np.std(motion.joint_torque[:, 0, 0] - given), np.std(given))
    assert np.std(motion.joint_torque[:, 0, 0] - given) < 0.1 * np.std(given)


FINGER = """
[simulation]
duration = 0.4
dt = 0.02

[[body]]
name = "finger"
mass = 0.2
inertia = 0.001

[[joint]]
name = "grip"
between = ["world", "finger"]
slider = { axis = [0, 1, 0] }
motor = { affine = { gain = 1, kv = 5, command_range = [-20, 20] } }
limits = [0, 0.03]

[[variable]]
name = "press"
sets = "grip.command"
knots = 20
interpolation = "constant"
guess = [-20, -20, -20, -20, -20, 20, 20, 20, 20, 20, -20, -20, -20, -20, -20, 20, 20, 20, 20, 20]

[[target]]
name = "t"
value = "grip.position"
tolerance = 0.1
"""


def test_a_light_finger_goes_from_stop_to_stop_in_a_step(make: Make) -> None:
    """What a motor moves from rest within a step is allowed for, without it nothing is."""
    made = make(FINGER)
    record = made.record(made.shooting.start(0))
    moved = np.abs(np.diff(record.motion.joint_value[:, 0, 0]))
    by_joint, by_body = quick_moves(made.rollout, record)
    assert moved.max() > 0.029 and np.all(moved <= by_joint["grip"][:, 0] + 1e-12)
    assert by_body[:, 0] == pytest.approx(by_joint["grip"][:, 0])
    assert 0.04 <= by_joint["grip"].max() < 0.085  # F dt^2 / m, and as much again for a command that turns
    still = record.arrays.x.copy()
    still[:, Layout(made.rollout.world)["grip.motor"]] = 0.0
    left = replace(record, along=np.zeros_like(record.along), arrays=replace(record.arrays, x=still))
    assert not quick_moves(made.rollout, left)[1].any()
