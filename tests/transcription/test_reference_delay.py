"""Delays of references: recorded commands that act later than they were given."""

from __future__ import annotations

from pathlib import Path

import pytest
from tools.parameter_slopes import slopes

from symphys.errors import ProblemError
from symphys.problem import load_problem

DRIVE = """
[simulation]
duration = 0.2
dt = 0.01
[world]
gravity = [0, 0, 0]
[[body]]
name = "wheel"
mass = 2
inertia = 0.05
[[joint]]
name = "axle"
between = ["world", "wheel"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0]
motor = { torque = { torque = 9 } }
[[reference]]
name = "given"
table = { time = [0, 1], u = [0, 2] }
DELAY
[[force]]
name = "drive"
on = "axle.command"
value = "given.u"
[[cost]]
name = "turn"
value = "VALUE"
[[variable]]
name = "late"
sets = "given.delay"
"""
LATE, SPAN, INERTIA = 0.05, 0.2, 0.05


def drive(folder: Path, delay: str = "delay = 0.05", value: str = "axle.rate") -> Path:
    """A wheel that is driven by a ramp of commands, 2 N m a second."""
    file = folder / "drive.toml"
    file.write_text(DRIVE.replace("DELAY", delay).replace("VALUE", value))
    return file


def test_commands_act_later(tmp_path: Path) -> None:
    """I rate = integral of 2 (t - delay) from the delay on, which the middles of steps give exactly."""
    value, exact, differences = slopes(drive(tmp_path))
    assert value == pytest.approx((SPAN - LATE) ** 2 / INERTIA, rel=1e-9)
    assert exact == pytest.approx(-2 * (SPAN - LATE) / INERTIA, rel=1e-9)
    assert differences == pytest.approx(exact, rel=1e-6)


def test_formulas_read_it_late(tmp_path: Path) -> None:
    value, exact, _ = slopes(drive(tmp_path, value="given.u"))
    assert (value, exact) == (pytest.approx(2 * (SPAN - LATE)), pytest.approx(-2))


def test_a_delay_that_is_stated_can_be_negative_and_has_its_scale(tmp_path: Path) -> None:
    (variable,) = load_problem(drive(tmp_path, "delay = 0")).variables
    assert (variable.guess, variable.scale) == (0, 0.01)
    assert variable.lower < -1e9


@pytest.mark.parametrize(
    ("delay", "message"),
    [
        ("", "a .*reference.* must state its delay, 0 too"),
        ('delay = "soon"', "delay"),
        ("delay = nan", "delay"),
    ],
)
def test_what_cannot_be(tmp_path: Path, delay: str, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        load_problem(drive(tmp_path, delay))


def test_a_column_called_delay(tmp_path: Path) -> None:
    file = drive(tmp_path)
    file.write_text(file.read_text().replace("u = [0, 2]", "u = [0, 2], delay = [0, 1]"))
    with pytest.raises(ProblemError, match="column"):
        load_problem(file)
