"""An arch of voussoirs stands as limit analysis says: thick and rough enough."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.textbook import G
from scipy.optimize import linprog
from tools.laboratory import Lab
from worlds.blocks import turned_by

from symphys.model.shapes import Box, Plane
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

COUNT = 5
PART = np.pi / COUNT
JOINTS = -np.pi / 2 + PART * np.arange(COUNT + 1)
"""Angles of the joints of a half-round arch of mean radius 1, from the vertical."""


def faces(thick: Any) -> tuple[Box, ...]:
    """The side faces of a voussoir, as thin slabs; z is outward from the arch's middle, x along the arch."""
    found = []
    for side in (-1, 1):
        lean, slab = side * PART / 2, 0.02
        outward, along = np.array([np.sin(lean), 0, np.cos(lean)]), np.array([np.cos(lean), 0, -np.sin(lean)])
        centre = outward - side * slab * along - np.array([0, 0, 1])
        found.append(Box((slab, 0.2, thick / 2), tuple(centre), tuple(turned_by((0, 1, 0), lean))))
    return tuple(found)


@cache
def arch() -> Lab:
    """Of voussoirs of 1 kg; friction and thickness are parameters. A slab meets its neighbour's, or the ground."""
    mu, thick = ca.SX.sym("mu"), ca.SX.sym("thick")
    bodies = [Body(f"v{k}", 1.0, (0.02, 0.03, 0.03), faces(thick)) for k in range(COUNT)]
    world = make_world(bodies, [Plane.ground()], Law(mu))
    feet = {(0, 0), (COUNT - 1, 1)}
    pairs = []
    for pair in world.pairs:
        first, second = pair.first, pair.second
        if second.body is None:
            meets = (first.body, first.shape) in feet
        else:
            meets = first.body is not None and (second.body - first.body, first.shape, second.shape) == (1, 1, 0)
        if meets:
            pairs.append(pair)
    return Lab(World(world.bodies, world.statics, tuple(pairs)), Scheme(sweeps=30, cuts=0), parameters=[mu, thick])


def can_stand(thick: float, mu: float) -> bool:
    """Whether forces within the cones at the edges of the joints balance every voussoir: a linear programme.

    Heyman, The stone skeleton, 1966; with friction Livesley 1978. Unknown at each edge: normal and tangential force.
    """
    count = 4 * (COUNT + 1)
    balance, load = np.zeros((3 * COUNT, count)), np.zeros(3 * COUNT)
    for j, angle in enumerate(JOINTS):
        out, along = np.array([np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), -np.sin(angle)])
        for edge, radius in enumerate((1 - thick / 2, 1 + thick / 2)):
            for kind, force in enumerate((along, out)):
                for block, f in ((j, force), (j - 1, -force)):
                    if 0 <= block < COUNT:
                        moment = radius * (out[0] * f[1] - out[1] * f[0])
                        balance[3 * block : 3 * block + 3, 4 * j + 2 * edge + kind] = [*f, moment]
    for block in range(COUNT):
        load[3 * block + 1 : 3 * block + 3] = G, np.sin(JOINTS[block] + PART / 2) * G
    cone = np.kron(np.eye(count // 2), [[-mu, 1], [-mu, -1]])
    bounds = [(0, None), (None, None)] * (count // 2)
    return bool(linprog(np.zeros(count), cone, np.zeros(count), balance, load, bounds).status == 0)


def fallen(thick: float, mu: float) -> float:
    """How far the keystone is lower after half a second [m]."""
    start: dict[str, Any] = {}
    for k in range(COUNT):
        angle = JOINTS[k] + PART / 2
        start[f"v{k}.position"] = [np.sin(angle), 0, np.cos(angle)]
        start[f"v{k}.orientation"] = turned_by((0, 1, 0), angle)
    z: Array = arch().states(start, 0.5, p=[mu, thick])["v2.position"][:, 2]
    return float(z[0] - z[-1])


@pytest.mark.thorough
def test_arch_stands_if_it_is_rough_enough() -> None:
    """Below the least friction no forces balance it and it falls; 10 % above, it stands."""
    rough = next(mu for mu in np.arange(0.1, 1.0, 0.001) if can_stand(0.3, mu))
    assert 0.2 < rough < 0.4
    assert fallen(0.3, 0.95 * rough) > 0.02
    assert abs(fallen(0.3, 1.1 * rough)) < 1e-3


@pytest.mark.thorough
def test_arch_stands_if_it_is_thick_enough() -> None:
    """The same of the least thickness."""
    thick = next(t for t in np.arange(0.03, 0.3, 0.001) if can_stand(t, 0.8))
    assert 0.07 < thick < 0.13
    assert fallen(0.95 * thick, 0.8) > 0.02
    assert abs(fallen(1.1 * thick, 0.8)) < 1e-3
