"""Numbers of contact laws as variables: what a motion makes of them, and its derivatives by them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tools.parameter_slopes import slopes

from symphys.errors import ProblemError
from symphys.problem import load_problem

BALL = """
[simulation]
duration = 0.3
dt = 0.01
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 0.5
position = [0, 0, 0.1]
velocity = VELOCITY
angular_velocity = SPIN
[[cost]]
name = "there"
value = "VALUE"
[ground]
"""
G, R, T = 9.81, 0.1, 0.3


def ball(
    folder: Path, tables: str, sets: str, value: str = "0", velocity: str = "[0, 0, 0]", spin: str = "[0, 0, 0]"
) -> Path:
    """A ball on the ground, and a variable."""
    file = folder / "ball.toml"
    text = BALL.replace("VALUE", value).replace("VELOCITY", velocity).replace("SPIN", spin)
    file.write_text(f'{text}{tables}\n[[variable]]\nname = "a"\nsets = "{sets}"\n')
    return file


@pytest.mark.parametrize(
    ("tables", "sets"),
    [
        ("[contact]\nfrequency = 10", "contact.frequency"),
        ('[contact]\nfrequency = 40\n[[pair]]\nbetween = ["ball", "ground"]\nfrequency = 10', "ball-ground.frequency"),
    ],
)
def test_a_ball_sinks_into_soft_ground_by_its_weight(tmp_path: Path, tables: str, sets: str) -> None:
    """A spring of stiffness m w^2 carries m g at a depth of g / w^2; critically damped, it is at rest by then."""
    value, slope, differences = slopes(ball(tmp_path, tables, sets, value="1000 * ball.position[2]"))
    depth = G / (2 * np.pi * 10) ** 2
    assert value == pytest.approx(1000 * (R - depth), abs=1e-3)
    assert slope == pytest.approx(1000 * 2 * depth / 10, rel=1e-2)
    assert slope == pytest.approx(differences, rel=1e-5)


def test_damping_of_soft_ground(tmp_path: Path) -> None:
    """With little of it the ball still swings: x'' + 2 d w x' + w^2 x = 0 about where it will rest."""
    file = ball(tmp_path, "[contact]\nfrequency = 4\ndamping = 0.3", "contact.damping", value="1000 * ball.position[2]")
    file.write_text(file.read_text().replace("dt = 0.01", "dt = 0.002"))
    value, slope, differences = slopes(file)
    omega = 8 * np.pi
    depth = G / omega**2

    def height(damping: float) -> float:
        rate = omega * np.sqrt(1 - damping**2)
        swing = np.cos(rate * T) + damping * omega / rate * np.sin(rate * T)
        return float(1000 * (R - depth * (1 - np.exp(-damping * omega * T) * swing)))

    assert value == pytest.approx(height(0.3), abs=0.02 * 1000 * depth)
    assert slope == pytest.approx((height(0.301) - height(0.299)) / 0.002, rel=0.1)
    assert slope == pytest.approx(differences, rel=1e-5)


@pytest.mark.parametrize(
    ("tables", "sets"),
    [
        ("[contact]\ntorsion = 0.004", "contact.torsion"),
        ('torsion = 0.001\n[[pair]]\nbetween = ["ball", "ground"]\ntorsion = 0.004', "ball-ground.torsion"),
        ("torsion = 0.004", "ground.torsion"),
    ],
)
def test_torsion_brakes_a_spin(tmp_path: Path, tables: str, sets: str) -> None:
    """By torsion m g / I, with I = 2/5 m r^2."""
    value, slope, differences = slopes(ball(tmp_path, tables, sets, value="ball.angular_velocity[2]", spin="[0, 0, 9]"))
    rate = -G * T / (0.4 * R**2)
    assert value == pytest.approx(9 + 0.004 * rate, rel=1e-6)
    assert slope == pytest.approx(rate, rel=1e-6)
    assert slope == pytest.approx(differences, rel=1e-5)


def test_rolling_friction_brakes_a_roll(tmp_path: Path) -> None:
    """By 5/7 rolling g / r."""
    tables = "[contact]\nfriction = 0.5\nrolling = 0.002"
    file = ball(tmp_path, tables, "contact.rolling", "ball.velocity[0]", velocity="[1, 0, 0]", spin="[0, 10, 0]")
    value, slope, differences = slopes(file)
    rate = -5 / 7 * G * T / R
    assert value == pytest.approx(1 + 0.002 * rate, rel=1e-6)
    assert slope == pytest.approx(rate, rel=1e-6)
    assert slope == pytest.approx(differences, rel=1e-5)


def test_friction_of_all_contacts_brakes_what_slides(tmp_path: Path) -> None:
    """By mu g, for as long as it slides: 2/7 v / (mu g) = 0.73 s."""
    file = ball(tmp_path, "[contact]\nfriction = 0.2", "contact.friction", "ball.velocity[0]", velocity="[5, 0, 0]")
    value, slope, differences = slopes(file)
    assert value == pytest.approx(5 - 0.2 * G * T, rel=1e-6)
    assert slope == pytest.approx(-G * T, rel=1e-6)
    assert slope == pytest.approx(differences, rel=1e-5)


def test_what_a_surface_states_hides_the_law_of_all_contacts(tmp_path: Path) -> None:
    file = ball(
        tmp_path, "friction = 0.3\n[contact]\nfriction = 0.2", "contact.friction", "ball.velocity[0]", "[5, 0, 0]"
    )
    assert slopes(file) == (pytest.approx(5 - 0.3 * G * T, rel=1e-6), 0, 0)


@pytest.mark.parametrize(
    ("tables", "sets", "more", "message"),
    [
        ("", "contact.frequency", "", "contact states no frequency: give it a value above 0 there first"),
        ("torsion = 0", "ground.torsion", "", "ground states no torsion: give it a value above 0 there first"),
        ("", "contact.damping", "", "contact states no damping: give it a value there first"),
        ("", "ground.frequency", "", r"has none to vary: \[contact\] and \[\[pair\]\] may state it"),
        ("[contact]\nfrequency = 9", "contact.frequency", "lower = 0", "contact.frequency must be greater than 0"),
        ("[contact]\nrolling = 0.1", "contact.rolling", "lower = -1", "contact.rolling must be at least 0"),
        (
            '[[pair]]\nbetween = ["ball", "ground"]\nfrequency = 9',
            "contact.restitution",
            "",
            "contact.restitution cannot vary: contact has soft contacts, which have no restitution",
        ),
    ],
)
def test_what_cannot_vary(tmp_path: Path, tables: str, sets: str, more: str, message: str) -> None:
    file = ball(tmp_path, tables, sets)
    file.write_text(f"{file.read_text()}\n{more}")
    with pytest.raises(ProblemError, match=message):
        load_problem(file)


def test_no_body_is_called_contact(tmp_path: Path) -> None:
    file = ball(tmp_path, "", "contact.friction")
    file.write_text(file.read_text().replace('name = "ball"', 'name = "contact"').replace("ball.", "contact."))
    with pytest.raises(ProblemError, match='"contact"'):
        load_problem(file)


def test_numbers_of_forces_are_free(tmp_path: Path) -> None:
    """What a force law calls damping or frequency is no coefficient of a contact."""
    law = '[[force]]\nname = "wind"\non = "ball.force[0]"\nnumbers = { damping = -2 }\nvalue = "wind.damping"\n'
    file = ball(tmp_path, law, "wind.damping")
    (variable,) = load_problem(file).variables
    assert (variable.lower, variable.upper, variable.guess) == (-np.inf, np.inf, -2)
