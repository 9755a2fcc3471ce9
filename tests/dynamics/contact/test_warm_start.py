"""What the sweeps start from adds no energy, and what carries a load at rest keeps it."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from worlds.contacts import contact_of, numbers

from symphys.dynamics.contact.body_term import BodyTerm
from symphys.dynamics.contact.constraint import ZERO_IMPULSE
from symphys.dynamics.contact.warm_start import shifting_points, within_energy
from symphys.dynamics.context import make_context
from symphys.dynamics.unknowns import Momentum, PlacedConstraint
from symphys.model.shapes import Box, Plane
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

MASS, FALLING = 2.0, -0.5


def boxes(on: str) -> World:
    """A box on the ground, or on another one."""
    bodies = [Body("box", MASS, (0.1, 0.1, 0.1), (Box((0.3, 0.2, 0.1)),))]
    if on == "box":
        bodies.append(Body("under", 1.0, (0.1, 0.1, 0.1), (Box((0.3, 0.2, 0.1)),)))
    return make_world(bodies, [Plane.ground()], Law())


def shortened(loads: Array, on: str = "box", scheme: Scheme | None = None) -> Array:
    """Loads of the points of both boxes, with the lower one held and the upper one falling."""
    world = boxes(on)
    context = make_context(world, scheme, (), ca.SX(0, 1), ca.SX(0))
    constraints, impulses, left = [], [], list(loads)
    for pair in world.pairs:
        term = BodyTerm(1, ca.SX(1 / MASS), ca.SX.eye(3), ca.SX([0, 0, -0.1]), ca.SX([0, 0, -0.1]))
        constraints.append(PlacedConstraint((0,), contact_of((term,), pair.law), (0,)))
        between = pair.second.body is not None or on == "ground"
        impulses.append(replace(ZERO_IMPULSE, normal=ca.SX(left.pop(0) if between and left else 0)))
    falling = Momentum(ca.SX([0, 0, FALLING]), ca.SX.zeros(3))
    found = within_energy(context, constraints, (falling, None), impulses)
    return np.array([float(numbers(each.normal)) for each in found if float(numbers(each.normal))])


def test_what_stops_a_fall_stays() -> None:
    loads = np.full(4, -MASS * FALLING / 4)
    assert shortened(loads) == pytest.approx(loads, rel=1e-15)


@pytest.mark.parametrize("times", [2.0, 3.0, 50.0])
def test_what_would_throw_back_faster_throws_back_as_fast(times: float) -> None:
    loads = np.full(4, -times * MASS * FALLING / 4)
    assert shortened(loads).sum() == pytest.approx(-2 * MASS * FALLING, rel=1e-12)


def test_points_on_the_ground_are_corners_and_keep_their_loads() -> None:
    assert not shifting_points(boxes("ground")) and len(shifting_points(boxes("box"))) == 4
    loads = np.full(4, 100.0)
    assert shortened(loads, "ground") == pytest.approx(loads)
    assert shortened(loads, scheme=Scheme(warm_start=False)) == pytest.approx(loads)
