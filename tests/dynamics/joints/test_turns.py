"""Joints that turn past half a turn: limits, servos and springs act where angles are told, and nothing jumps."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import symphys
from symphys import Body, Hinge, Problem, Servo, Spring, make_world
from symphys.model.joints.turn import natural_centre, outside

FAR = 3.9
"""[rad], more than half a turn."""


def turned(spin: float = 0.0, duration: float = 1.5, **more: object) -> symphys.Trajectory:
    """A wheel on a hinge about y, without gravity."""
    wheel = Body.ball("wheel", radius=0.1, mass=1.0, angular_velocity=(0, spin, 0))
    hinge = Hinge("axle", ("world", "wheel"), axis=(0, 1, 0), point=(0, 0, 0), **more)  # type: ignore[arg-type]
    world = make_world([wheel], joints=[hinge], gravity=(0, 0, 0))
    variables = {"aim": {"sets": "axle.command", "guess": [FAR - 0.4]}} if "motor" in more else {}
    return symphys.simulate(Problem.from_world(world, duration=duration, dt=0.01, variables=variables))


def test_a_limit_beyond_half_a_turn_stops_and_holds() -> None:
    found = turned(spin=5.0, limits=(-0.5, FAR))
    angle, rate = found["axle.angle"], found["axle.rate"]
    free = np.minimum(5.0 * found.time, FAR)
    np.testing.assert_allclose(angle, free, atol=1e-6)
    assert abs(rate[-1]) < 1e-9


def test_one_limit_leaves_the_other_way_open_for_a_turn() -> None:
    found = turned(spin=4.0, duration=1.3, limits=(-0.5, None))
    np.testing.assert_allclose(found["axle.angle"], 4.0 * found.time, atol=1e-9)
    assert 4.0 * found.time[-1] > pi + 2


def test_springs_and_servos_pull_the_way_that_is_told() -> None:
    rest = turned(spring=Spring(stiffness=0.5, damping=0.1, rest=FAR - 0.4), centre=2.0, duration=4.0)
    assert rest["axle.angle"][-1] == pytest.approx(FAR - 0.4, abs=1e-3)
    assert np.all(np.diff(rest["axle.angle"][:20]) >= 0)
    servo = turned(motor=Servo(gain=10, torque=5, velocity=20), limits=(-0.5, FAR), duration=2.0)
    assert servo["axle.angle"][-1] == pytest.approx(FAR - 0.4, abs=1e-4)


@pytest.mark.parametrize(
    ("lower", "upper", "centre"),
    [(-1.0, 1.5, 0.0), (-0.5, 4.0, 1.75), (-4.0, 4.0, 0.0), (-0.5, None, pi - 1.0), (None, 0.5, 1.0 - pi)],
)
def test_the_centre_follows_from_the_limits(lower: float | None, upper: float | None, centre: float) -> None:
    assert natural_centre(lower, upper) == pytest.approx(centre)


def test_ends_within_the_turn_that_is_told_are_fine() -> None:
    assert outside(3.0, 0.0) == "" and outside(FAR, 1.7) == ""
    assert "lie between -3.142 and 3.142 rad" in outside(FAR, 0.0)
