"""Bodies by their shapes: mass and inertia against closed forms, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import casadi as ca
import numpy as np
import pytest

from symphys import SymphysError
from symphys.model import Body, Box, Capsule, Sphere
from symphys.model.joints.placing import REST


def test_a_box() -> None:
    """m / 12 (b^2 + c^2), from full edges."""
    body = Body.box("crate", (0.4, 0.3, 0.2), 6.0)
    assert body.shapes == (Box((0.2, 0.15, 0.1)),)
    assert body.inertia == pytest.approx(tuple(6 / 12 * np.array([0.09 + 0.04, 0.16 + 0.04, 0.16 + 0.09])))
    assert Body.box("crate", (0.4, 0.3, 0.2), density=250).mass == pytest.approx(6.0)


def test_a_capsule() -> None:
    """A cylinder and two half balls whose centres of mass are 3/8 r beyond its ends."""
    r, length, density = 0.1, 0.5, 700.0
    body = Body.capsule("club", r, length, density=density)
    rod, ends = density * pi * r**2 * length, density * 4 / 3 * pi * r**3
    assert body.mass == pytest.approx(rod + ends)
    about = rod * r**2 / 2 + ends * 2 / 5 * r**2
    half_ball = (2 / 5 - (3 / 8) ** 2) * r**2 + (length / 2 + 3 / 8 * r) ** 2
    across = rod * (r**2 / 4 + length**2 / 12) + ends * half_ball
    assert body.inertia == pytest.approx((across, across, about))


def test_balls() -> None:
    solid, hollow = Body.ball("a", 0.2, 3.0), Body.ball("b", 0.2, 3.0, hollow=True)
    assert (solid.inertia, hollow.inertia) == (pytest.approx(2 / 5 * 0.12), pytest.approx(2 / 3 * 0.12))
    assert Body.ball("a", 0.2, density=100).mass == pytest.approx(100 * 4 / 3 * pi * 0.008)


def test_a_compound() -> None:
    """A dumbbell: two balls away from the centre (Steiner), and a bar whose share in the mass is that in the volume."""
    parts = (Sphere(0.1, (0.3, 0, 0)), Sphere(0.1, (-0.3, 0, 0)), Box((0.2, 0.02, 0.03)))
    ball, bar = 4 / 3 * pi * 1e-3 * 900, 8 * 0.2 * 0.02 * 0.03 * 900
    body = Body.compound("dumbbell", parts, density=900)
    own = 2 * ball * 2 / 5 * 0.01
    x, y, z = own, own + 2 * ball * 0.09, own + 2 * ball * 0.09
    edges = np.array([0.04**2 + 0.06**2, 0.4**2 + 0.06**2, 0.4**2 + 0.04**2]) * bar / 12
    assert body.mass == pytest.approx(2 * ball + bar)
    assert body.inertia == pytest.approx(tuple(np.array([x, y, z]) + edges))
    assert Body.compound("dumbbell", parts, body.mass).inertia == pytest.approx(body.inertia)


def test_symbols_stay_symbols() -> None:
    mass, edge = ca.SX.sym("mass"), ca.SX.sym("edge")
    body = Body.box("crate", (edge, 0.3, 0.2), mass)
    moment = ca.Function("moment", [mass, edge], [body.inertia[2]])
    assert float(moment(6, 0.4)) == pytest.approx(6 / 12 * (0.16 + 0.09))


def test_the_start_is_no_part_of_a_body() -> None:
    """Two bodies that begin elsewhere are equal; an orientation has length 1, whatever is given."""
    still = Body.ball("ball", 0.1, 1.0)
    moved = Body.ball("ball", 0.1, 1.0, position=np.array([0, 0, 1]), orientation={"yaw_deg": 60})
    assert (moved == still, hash(moved) == hash(still)) == (True, True)
    assert moved.start["position"] == (0, 0, 1)
    assert moved.start["orientation"] == pytest.approx((np.cos(pi / 6), 0, 0, np.sin(pi / 6)))
    assert Body("x", 1.0, 1.0, start={"orientation": (3, 0, 4, 0)}).start["orientation"] == pytest.approx(
        (0.6, 0, 0.8, 0)
    )
    assert set(moved.start) < set(REST)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Body.box("b", (1, 2), 1.0), r"size must be 3 positive lengths \[m\], not \(1, 2\)"),
        (lambda: Body.box("b", (1, 2, -1), 1.0), "size must be 3 positive lengths"),
        (lambda: Body.ball("b", "wide", 1.0), "radius must be a positive length"),
        (lambda: Body.ball("b", 0.1), "give either mass"),
        (lambda: Body.ball("b", 0.1, 1.0, density=1.0), "give either mass"),
        (lambda: Body.ball("b", 0.1, -1.0), "mass must be positive, not -1"),
        (lambda: Body.ball("b", 0.1, density=1.0, hollow=True), "thin shell"),
        (lambda: Body.capsule("b", 1.0, 1e-9, 1.0), "use a sphere"),
        (lambda: Body.compound("b", [Sphere(0.1, (1.0, 0, 0))], 1.0), r"1 m from the body's origin, at \[1, 0, 0\]"),
        (lambda: Body.compound("b", [], 1.0), "needs shapes"),
        (lambda: Body.ball("b", 0.1, 1.0, positon=(0, 0, 0)), '"position"'),
        (lambda: Body.ball("b", 0.1, 1.0, velocity=ca.SX.sym("v", 3)), "symbols go into initial_state"),
        (lambda: Body.ball("b", 0.1, 1.0, velocity=(0, 0)), "velocity must be 3 numbers"),
        (lambda: Body.ball("b", 0.1, 1.0, orientation=(0, 0, 0, 0)), r"orientation: .*quaternion"),
        (lambda: Body.ball("b", 0.1, 1.0, orientation={"yaw": 1}), "has no yaw; valid: roll_deg"),
    ],
)
def test_what_cannot_be_is_named(make: Callable[[], Any], said: str) -> None:
    with pytest.raises(SymphysError, match=f'body "b": .*{said}'):
        make()


def test_shapes_of_a_compound_keep_their_places() -> None:
    parts = (Capsule(0.1, 0.2, (0, 0.1, 0), (0.6, 0.8, 0, 0)), Capsule(0.1, 0.2, (0, -0.1, 0), (0.6, 0.8, 0, 0)))
    assert Body.compound("pair", parts, 1.0).shapes == parts
