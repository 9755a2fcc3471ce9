"""How corners share a load: linearly, whatever was before, and friction follows; against a plate with linear loads."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab
from worlds.blocks import block
from worlds.plate import Plate

from symphys.dynamics.contact.warm_start import faces
from symphys.model.shapes import Box, Plane
from symphys.model.world import Body, Law, Scheme, make_world
from symphys.types import Array

HALVES, FRICTION = (0.15, 0.2, 0.1), 0.3
FEET = [f"b-ground:{k}.force" for k in range(8)]


@cache
def lab(dt: float = 0.01, load_sharing: bool = True) -> Lab:
    world = make_world([block("b", HALVES)], [Plane.ground()], Law(FRICTION))
    return Lab(world, Scheme(dt=dt, load_sharing=load_sharing, newton_start=load_sharing))


def loads(states: dict[str, Array], k: int) -> Array:
    """(8,) [N]: how the corners carry the box at a step."""
    return np.array([states[name][k, 2] for name in FEET])


def slid(dt: float, load_sharing: bool = True) -> float:
    """The angle at rest of a crate that slides and turns [rad]."""
    start = {"b.position": [0, 0, 0.1], "b.velocity": [2.4, 0.27, 0], "b.angular_velocity": [0, 0, 2.67]}
    q = lab(dt, load_sharing).states(start, 1.5)["b.orientation"][-1]
    return float(2 * np.arctan2(q[3], q[0]))


def turned() -> float:
    """The same angle of a plate whose loads are linear."""
    plate = Plate((2 * HALVES[0], 2 * HALVES[1]), HALVES[2], FRICTION)
    return float(plate.slid([2.4, 0.27, 2.67])[2])


@pytest.mark.slow
def test_a_turning_crate_goes_as_with_linear_loads() -> None:
    """Without sharing it goes elsewhere."""
    assert abs(slid(0.01) - turned()) < 0.005
    assert abs(slid(0.01, load_sharing=False) - turned()) > 5 * abs(slid(0.01) - turned())


@pytest.mark.thorough
def test_a_turning_crate_approaches_linear_loads_with_the_step() -> None:
    """At first order in dt, since friction is that of the step's end; without sharing it goes elsewhere."""
    errors = [abs(slid(dt) - turned()) for dt in (0.02, 0.01, 0.005)]
    assert errors[0] < 0.01
    assert errors[2] < errors[1] / 1.7 < errors[0] / 1.7**2
    assert abs(slid(0.005, load_sharing=False) - turned()) > 10 * errors[2]


@pytest.mark.slow
@pytest.mark.parametrize(("load_sharing", "most"), [(True, 1e-4), (False, 10.0)])
def test_what_was_before_is_forgotten(load_sharing: bool, most: float) -> None:
    """Forces across the diagonal, which have no resultant, are added to a crate at rest."""
    here = lab(load_sharing=load_sharing)
    rest = ca.DM(here.trajectory({"b.position": [0, 0, 0.1]}, 0.5)[:, -1])
    corners = [k for k in range(8) if rest[here.layout[FEET[k]]][2] > 0.1]
    assert len(corners) == 4
    changed = ca.DM(rest)
    for k, sign in zip(corners, (1, -1, -1, 1), strict=True):
        changed[here.layout[FEET[k]].start + 2] += sign
    for _ in range(4):
        changed = here.step(changed, [], [], 0)
    left = [float(changed[here.layout[FEET[k]].start + 2]) - 9.81 / 4 for k in corners]
    assert np.abs(left).max() < most
    assert load_sharing or np.abs(left).max() > 0.5
    assert np.abs(np.array(changed[here.layout["b.velocity"]])).max() < 1e-9


def test_loads_are_linear_across_a_braking_crate() -> None:
    """Friction below the middle loads the front: mu m g h of torque, shared by arms of half a length."""
    start = {"b.position": [0, 0, 0.1], "b.velocity": [2.0, 0, 0]}
    found = loads(lab().states(start, 0.3), -1)
    shift = FRICTION * 9.81 * HALVES[2] / (4 * HALVES[0])
    assert sorted(found)[4:] == pytest.approx([9.81 / 4 - shift] * 2 + [9.81 / 4 + shift] * 2, rel=1e-6)


@pytest.mark.slow
def test_a_crate_on_its_edge_keeps_its_loads() -> None:
    """Two corners say how they share a load; the others, in the air, get none.

    Sweeps alone turn the crate by 1e-8 about the other axes, which symmetry forbids.
    """
    tilt = 0.3
    up = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    low = (up @ np.array([0.15, 0.2, -0.1]))[2]
    start = {"b.position": [0, 0, -low], "b.orientation": [np.cos(tilt / 2), 0, np.sin(tilt / 2), 0]}
    with_it, without = (lab(load_sharing=share).states(start, 0.05) for share in (True, False))
    assert loads(with_it, 3) == pytest.approx(loads(without, 3), abs=1e-6)
    assert with_it["b.orientation"][-1] == pytest.approx(without["b.orientation"][-1], abs=2e-8)
    assert np.abs(with_it["b.orientation"][-1][[1, 3]]).max() < 1e-14


def test_points_that_share() -> None:
    """Corners on a plane or a box; not a ball's one point, nor what is soft."""
    ball = Body.ball("a", 0.1, 1.0)
    table = Body("t", 1.0, 0.1, tuple(Box((0.05, 0.05, 0.2), (x, y, 0)) for x in (-0.5, 0.5) for y in (-0.5, 0.5)))
    assert [len(group) for group in faces(make_world([ball], [Plane.ground()], Law(0.5)))] == []
    assert [len(group) for group in faces(make_world([table], [Plane.ground()], Law(0.5)))] == [32]
    assert [len(group) for group in faces(make_world([table], [Plane.ground()], Law(0.5, frequency=5.0)))] == []
