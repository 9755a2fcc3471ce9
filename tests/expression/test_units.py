"""Units of formulas: those that follow from their names, and none where a rule leaves doubt."""

from __future__ import annotations

import pytest

from symphys.expression import parse
from symphys.expression.units import read, unit_of, written

UNITS = {
    "ball.position": "m",
    "ball.velocity": "m/s",
    "ball.angular_velocity": "rad/s",
    "ball.orientation": "",
    "ball.mass": "kg",
    "ball.force": "N",
    "knee.angle": "rad",
    "knee.torque": "N m",
    "gravity": "m/s^2",
    "time": "s",
}


@pytest.mark.parametrize(
    ("formula", "unit"),
    [
        ("ball.position[0] - 10", "m"),
        ("10 - ball.position[0:2]", "m"),
        ("-ball.velocity", "m/s"),
        ("norm(ball.position - [1, 2, 3])", "m"),
        ("[ball.position[0], 0.5]", "m"),
        ("max(ball.position[2], 0)", "m"),
        ("hypot(ball.position[0], ball.position[1] - 1)", "m"),
        ("mean(ball.velocity)", "m/s"),
        ("knee.angle - pi", "rad"),
        ("ball.velocity * time", "m"),
        ("ball.position / time", "m/s"),
        ("0.5 * ball.mass * sumsqr(ball.velocity)", "N m"),
        ("ball.mass * ball.velocity[0] / time", "N"),
        ("sqrt(sumsqr(ball.position))", "m"),
        ("ball.velocity[2]**2", "m^2/s^2"),
        ("1 / time", "1/s"),
        ("2 * ball.velocity[0]**2 / ball.position[0]", "m/s^2"),
        ("knee.torque", "N m"),
        ("dot(ball.velocity, [1, 0, 0])", "m/s"),
        ("rotate(ball.orientation, [1, 0, 0])[2] + 0 * time", ""),
        ("atan2(ball.velocity[1], ball.velocity[0])", "rad"),
        ("ball.position[0] * sin(knee.angle)", "m"),
        ("rotate(ball.orientation, ball.velocity)", "m/s"),
    ],
)
def test_what_follows_from_the_names(formula: str, unit: str) -> None:
    assert unit_of(parse(formula), UNITS) == unit


@pytest.mark.parametrize(
    "formula",
    [
        "ball.position[0] + ball.velocity[0]",
        "[ball.position[0], ball.velocity[0]]",
        "9.81 * ball.position[2]",
        "ball.position[0] / 10",
        "knee.angle * 180 / pi",
        "sin(ball.position[0])",
        "exp(time)",
        "sqrt(ball.position[0])",
        "ball.position[0] ** ball.position[1]",
        "ball.position[0] ** 0.5",
        "ball.position[0] * ball.angular_velocity[0]",
        "ball.position[0] + knee.angle",
        "unknown.name - 1",
        "unknown.name * ball.position[0]",
        "sin(knee.angle)",
        "ball.orientation[0]",
        "ball.position[0] / ball.position[1]",
        "sign(ball.position[0])",
        "1.5",
        "rotate(ball.orientation, [1, 0, 0])",
    ],
)
def test_pure_numbers_and_what_is_in_doubt_have_none(formula: str) -> None:
    assert unit_of(parse(formula), UNITS) == ""


@pytest.mark.parametrize("unit", ["m", "m/s", "m/s^2", "rad/s", "N", "N m", "N/m", "kg", "m^2/s^2", "1/s", ""])
def test_units_are_read_and_written_alike(unit: str) -> None:
    found = read(unit)
    assert found is not None and written(found) == unit


def test_a_unit_that_is_not_known_is_none() -> None:
    assert read("furlong") is None
    assert unit_of(parse("a.b - 1"), {"a.b": "furlong"}) == ""
