"""Numbers of joints and motors as variables: closed forms of a wheel on an axle, and derivatives by them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tools.parameter_slopes import slopes, slopes_of
from tools.repeats import few

from symphys.errors import ProblemError
from symphys.problem import load_problem

WHEEL = """
[simulation]
duration = 0.2
dt = 0.01
[world]
gravity = [0, 0, 0]
[[body]]
name = "wheel"
mass = 2
inertia = 0.05
angular_velocity = [0, RATE, 0]
[[joint]]
name = "axle"
between = ["world", "wheel"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0]
JOINT
[[variable]]
name = "input"
sets = "axle.command"
lower = 0.7
upper = 0.7
guess = 0.7
[[cost]]
name = "turn"
value = "VALUE"
"""
MOTOR = "motor = { affine = { gain = 2, offset = 0.1, kp = KP, kv = KV, gear = 3 } }"
INERTIA, T = 0.05, 0.2


def wheel(folder: Path, joint: str, sets: str, value: str = "axle.rate", rate: float = 0, more: str = "") -> Path:
    """A wheel with one variable beside its command."""
    file = folder / "wheel.toml"
    text = WHEEL.replace("JOINT", joint).replace("VALUE", value).replace("RATE", str(rate))
    if "motor" not in joint:
        text = text[: text.index("[[variable]]")] + text[text.index("[[cost]]") :]
    file.write_text(f'{text}[[variable]]\nname = "a"\nsets = "{sets}"\n{more}')
    return file


def test_armature_adds_to_inertia(tmp_path: Path) -> None:
    """The rate after a constant torque of 0.7 N m is 0.7 t / (I + armature)."""
    file = wheel(tmp_path, "motor = { torque = { torque = 9 } }\narmature = 0.02", "axle.armature")
    value, exact, differences = slopes_of(file)
    assert value == pytest.approx(0.7 * T / (INERTIA + 0.02), rel=1e-9)
    assert exact[1] == pytest.approx(-0.7 * T / (INERTIA + 0.02) ** 2, rel=1e-9)
    assert differences[1] == pytest.approx(exact[1], rel=1e-6)


def test_dry_friction_brakes(tmp_path: Path) -> None:
    """By friction t / I, as long as it turns."""
    value, exact, differences = slopes(wheel(tmp_path, "friction = 0.3", "axle.friction", rate=3))
    assert value == pytest.approx(3 - 0.3 * T / INERTIA, rel=1e-9)
    assert exact == pytest.approx(-T / INERTIA, rel=1e-9)
    assert differences == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize(
    ("sets", "slope"),
    [("gain", 3 * 0.7 * T / INERTIA), ("offset", 3 * T / INERTIA), ("gear", (2 * 0.7 + 0.1) * T / INERTIA)],
)
def test_an_affine_motor(tmp_path: Path, sets: str, slope: float) -> None:
    """The rate is gear (gain command + offset) t / I."""
    file = wheel(tmp_path, MOTOR.replace("KP", "0").replace("KV", "0"), f"axle.{sets}")
    value, exact, differences = slopes_of(file)
    assert value == pytest.approx(3 * (2 * 0.7 + 0.1) * T / INERTIA, rel=1e-9)
    assert exact[1] == pytest.approx(slope, rel=1e-9)
    assert differences[1] == pytest.approx(exact[1], rel=1e-6)


@few("stated", [(0, 0), (0.02, 0), (0, 0.01), (0.02, 0.01)], 3)
@pytest.mark.parametrize("sets", ["kp", "kv"])
def test_an_affine_motor_with_feedback(tmp_path: Path, stated: tuple[float, float], sets: str) -> None:
    """I q'' = gear (gain u + offset) - kp gear^2 q - kv gear^2 q', where the file has no feedback too."""
    guess = {"kp": 0.02, "kv": 0.01}[sets]
    motor = MOTOR.replace("KP", str(stated[0])).replace("KV", str(stated[1]))
    file = wheel(tmp_path, motor, f"axle.{sets}", "axle.angle", more=f"guess = {guess}\n")
    file.write_text(file.read_text().replace("dt = 0.01", "dt = 0.002"))
    kp, kv = (guess if sets == "kp" else stated[0]), (guess if sets == "kv" else stated[1])
    value, exact, differences = slopes_of(file)
    assert value == pytest.approx(turned(kp, kv), rel=2e-3)
    step = 1e-4
    by = (step, 0) if sets == "kp" else (0, step)
    expected = (turned(kp + by[0], kv + by[1]) - turned(kp - by[0], kv - by[1])) / (2 * step)
    assert exact[1] == pytest.approx(expected, rel=1e-2)
    assert differences[1] == pytest.approx(exact[1], rel=1e-5)


def turned(kp: float, kv: float) -> float:
    """The angle at the end, with the matrix exponential of the linear system."""
    system = np.array([[0, 1, 0], [-9 * kp / INERTIA, -9 * kv / INERTIA, 3 * (2 * 0.7 + 0.1) / INERTIA], [0, 0, 0]])
    power, whole = np.eye(3), np.eye(3)
    for k in range(1, 25):
        power = power @ system * T / k
        whole = whole + power
    return float(whole[0, 2])


@pytest.mark.parametrize(
    ("joint", "sets", "more", "message"),
    [
        ("", "axle.armature", "", "axle states no armature: give it a value above 0 there first"),
        ("", "axle.friction", "", "axle states no friction: give it a value above 0 there first"),
        ("armature = 0.1", "axle.armature", "lower = -1", "axle.armature must be at least 0"),
        ("friction = 0.1", "axle.frequency", "", "did you mean|valid"),
    ],
)
def test_what_cannot_vary(tmp_path: Path, joint: str, sets: str, more: str, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        load_problem(wheel(tmp_path, joint, sets, more=more))
