"""Loads of a face become linear across it, and keep their sum and their torque."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from worlds.contacts import contact_of, numbers

from symphys.dynamics.contact.body_term import BodyTerm
from symphys.dynamics.contact.constraint import ZERO_IMPULSE
from symphys.dynamics.contact.warm_start import distribute_loads
from symphys.dynamics.context import make_context
from symphys.dynamics.unknowns import PlacedConstraint
from symphys.model.shapes import Box, Plane
from symphys.model.world import Body, Law, Scheme, make_world
from symphys.types import Array

CORNERS = np.array([(x, y) for x in (-0.3, 0.3) for y in (-0.2, 0.2)])


def distributed(loads: Array, scheme: Scheme | None = None) -> Array:
    """The loads of a box's lower corners; the upper ones carry none."""
    world = make_world([Body("box", 1.0, (0.1, 0.1, 0.1), (Box((0.3, 0.2, 0.1)),))], [Plane.ground()], Law())
    context = make_context(world, scheme, (), ca.SX(0, 1), ca.SX(0))
    places = [(*corner, -0.1) for corner in CORNERS] + [(*corner, 0.1) for corner in CORNERS]
    constraints = []
    for place in places:
        term = BodyTerm(1, ca.SX(1.0), ca.SX.eye(3), ca.SX(place), ca.SX(place))
        constraints.append(PlacedConstraint((0,), contact_of((term,), Law(), load=ca.SX(1e-3)), (0,)))
    impulses = [replace(ZERO_IMPULSE, normal=ca.SX(load)) for load in (*loads, 0, 0, 0, 0)]
    found = distribute_loads(context, constraints, impulses)
    return np.array([float(numbers(each.normal)) for each in found])[:4]


def test_resultant_and_torque_stay() -> None:
    loads = np.array([4.0, 1.0, 2.0, 2.5])
    found = distributed(loads)
    assert found.sum() == pytest.approx(loads.sum(), rel=1e-3)
    assert found @ CORNERS == pytest.approx(loads @ CORNERS, rel=1e-2)
    assert found[0] - found[1] - found[2] + found[3] == pytest.approx(0, abs=1e-2)


def test_linear_loads_stay_as_they_are() -> None:
    loads = 3 + CORNERS @ [2.0, -1.0]
    assert distributed(loads) == pytest.approx(loads, rel=1e-6)


def test_its_switch_leaves_loads_alone() -> None:
    loads = np.array([4.0, 1.0, 2.0, 2.5])
    assert distributed(loads, Scheme(load_sharing=False)) == pytest.approx(loads)
