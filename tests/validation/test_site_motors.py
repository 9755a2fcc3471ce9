"""Motors at sites push and turn bodies as Newton and Euler say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import fresnel

import symphys
from symphys import Problem, simulate
from symphys.cli import main
from symphys.types import Array

MASS, INERTIA, ARM, THRUST = 2.0, 0.05, 0.1, 1.5


def pushed(dt: float, command: float = 1.0, **motor: Any) -> Problem:
    """A plate in the plane, pushed at a corner, across the way to its centre."""
    wanted = {"force": [0, THRUST, 0], **motor}
    return symphys.load(
        {
            "simulation": {"duration": 2.0, "dt": dt},
            "world": {"gravity": [0, 0, 0]},
            "body": [{"name": "plate", "mass": MASS, "inertia": INERTIA}],
            "site": [{"name": "jet", "body": "plate", "position": [ARM, 0, 0], "motor": wanted}],
            "variable": [{"name": "push", "sets": "jet.command", "guess": command}],
            "target": [{"name": "there", "value": "plate.position[0] - 1", "tolerance": 0.1}],
        }
    )


def spiral(time: float) -> Array:
    """(2,) Where a plate is that is pushed across a turning axis: the integral of Fresnel's integrals [m]."""
    alpha = ARM * THRUST / INERTIA
    scale = np.sqrt(np.pi / alpha)
    s, c = fresnel(time / scale)
    turned = alpha * time**2 / 2
    # d/dt of t S - ..: the integral of S(u) is u S(u) + cos(pi u^2 / 2) / pi - 1 / pi, that of C u C - sin(..) / pi
    across = scale * (time * c - scale * np.sin(turned) / np.pi)
    along = -scale * (time * s + scale * (np.cos(turned) - 1) / np.pi)
    return THRUST / MASS * np.array([along, across])


def test_a_thrust_that_turns_with_its_body_leads_along_fresnels_spiral() -> None:
    """To second order in the step."""
    errors = []
    for dt in (0.02, 0.01):
        motion = simulate(pushed(dt))
        errors.append(np.linalg.norm(motion.position[-1, 0, :2] - spiral(2.0)))
        assert motion.angular_velocity[-1, 0, 2] == pytest.approx(2 * ARM * THRUST / INERTIA, rel=1e-12)
    assert errors[1] < 2e-4
    assert errors[0] == pytest.approx(4 * errors[1], rel=0.05)


def test_what_is_reported_to_act_changes_momentum_and_energy() -> None:
    motion = simulate(pushed(0.01))
    steps = 0.01 * motion.force[:, 0]
    np.testing.assert_allclose(MASS * motion.velocity[-1, 0], steps.sum(axis=0), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(motion.force[:, 0], axis=1), THRUST, rtol=1e-12)
    np.testing.assert_allclose(motion.torque[:, 0, 2], ARM * THRUST, rtol=1e-12)
    moved = np.diff(motion.position[:, 0], axis=0)
    work = (motion.force[:, 0] * moved).sum() + ARM * THRUST * (ARM * THRUST / INERTIA) * 2.0**2 / 2
    kinetic = MASS * (motion.velocity[-1, 0] ** 2).sum() / 2 + INERTIA * motion.angular_velocity[-1, 0, 2] ** 2 / 2
    assert work == pytest.approx(kinetic, rel=2e-5)


def test_commands_are_held_within_their_range() -> None:
    wide, held = (simulate(pushed(0.02, 9.0, **ends)).position[-1] for ends in ({}, {"command_range": [-2, 4]}))
    np.testing.assert_array_equal(held, simulate(pushed(0.02, 4.0)).position[-1])
    assert np.abs(wide - held).max() > 0.1


def test_the_axes_of_the_site_turn_force_and_torque() -> None:
    """A site turned by 90 degrees about x: its z is the body's -y, and a torque about it turns the body about that."""
    problem = symphys.load(
        {
            "simulation": {"duration": 0.1, "dt": 0.01},
            "world": {"gravity": [0, 0, 0]},
            "body": [{"name": "cube", "mass": 1, "inertia": 1}],
            "site": [
                {
                    "name": "rotor",
                    "body": "cube",
                    "orientation": {"roll_deg": 90},
                    "motor": {"force": [0, 0, 2], "torque": [0, 0, 3]},
                }
            ],
            "variable": [{"name": "u", "sets": "rotor.command", "guess": 1.0}],
            "cost": [{"name": "effort", "at": "always", "squares": "rotor.command"}],
        }
    )
    motion = simulate(problem)
    np.testing.assert_allclose(motion.velocity[-1, 0], [0, -0.2, 0], atol=1e-12)
    np.testing.assert_allclose(motion.angular_velocity[-1, 0], [0, -0.3, 0], atol=1e-12)


@pytest.mark.slow
def test_a_thrust_at_the_end_of_a_bar_is_a_torque_at_its_hinge() -> None:
    """The reaction of the hinge as well, to second order in the step."""
    bar = {
        "simulation": {"duration": 1.0, "dt": 0.005},
        "body": [{"name": "bar", "mass": 1, "inertia": 0.1, "position": [0.5, 0, 0], "collides_with": []}],
        "joint": [{"name": "hinge", "between": ["world", "bar"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0, 0]}],
        "sensor": [{"name": "pull", "reads": "hinge.reaction_force"}],
    }
    jet = {"name": "jet", "body": "bar", "position": [0.5, 0, 0], "motor": {"force": [0, 0, 1]}}
    by_jet = {**bar, "site": [jet], "variable": [{"name": "u", "sets": "jet.command", "guess": 6.0}]}
    by_motor = {**bar, "joint": [{**bar["joint"][0], "motor": {"affine": {}}}]}
    by_motor["variable"] = [{"name": "u", "sets": "hinge.command", "guess": -6.0}]
    cost = [{"name": "turned", "value": "hinge.angle"}]
    one, other = (simulate(symphys.load({**each, "cost": cost})) for each in (by_jet, by_motor))
    np.testing.assert_allclose(one["hinge.angle"], other["hinge.angle"], atol=1e-4)
    assert np.abs(one["hinge.angle"]).max() > 0.3


@pytest.mark.parametrize(
    ("site", "said"),
    [
        ({"body": "world", "motor": {"force": [0, 0, 1]}}, "belongs to the world"),
        ({"body": "plate", "motor": {}}, "does nothing"),
        ({"body": "plate", "motor": {"force": [0, 1]}}, "force"),
        ({"body": "plate", "motor": {"thrust": 2}}, "thrust"),
        ({"body": "plate", "motor": {"force": [0, 0, 1], "command_range": [3, 1]}}, "must not be above"),
    ],
)
def test_a_motor_that_is_none_is_refused(site: dict[str, Any], said: str, tmp_path: Any, capsys: Any) -> None:
    rest = "\n".join(f"{key} = {_text(value)}" for key, value in site.items())
    path = tmp_path / "bad.toml"
    path.write_text(
        "[simulation]\nduration = 1\ndt = 0.1\n[[body]]\nname = 'plate'\nmass = 1\ninertia = 1\n"
        f"[[site]]\nname = 'jet'\n{rest}\n"
        "[[variable]]\nname = 'v'\nsets = 'plate.velocity'\n[[cost]]\nname = 'c'\nvalue = 'plate.position[0]'\n"
    )
    assert main(["check", str(path)]) == 2
    assert said in capsys.readouterr().err


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_text(each)}" for key, each in value.items()) + " }"
    return f"'{value}'" if isinstance(value, str) else str(value)
