"""Dominoes that fall on each other: points of their faces change places in every step, and none of it adds energy."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from tools.laboratory import Lab
from tools.repeats import thorough
from worlds.linkage import energy

from symphys.model.shapes import Box, Plane, Sphere
from symphys.model.world import Body, Law, Scheme, make_world
from symphys.types import Array

HALF, MASS, APART = np.array([0.005, 0.015, 0.03]), 0.01, 0.04
INERTIA = MASS / 3 * (HALF @ HALF - HALF**2)
RADIUS, HEAVY = 0.02, 0.03


@cache
def row(count: int, dt: float) -> Lab:
    """A ball, then dominoes; each meets its neighbours and the ground."""
    ball = Body("ball", HEAVY, 0.4 * HEAVY * RADIUS**2, (Sphere(RADIUS),))
    bodies = [ball, *(Body(f"d{k}", MASS, tuple(INERTIA), (Box(tuple(HALF)),)) for k in range(count))]
    apart = {(a.name, b.name): None for k, a in enumerate(bodies) for b in bodies[k + 2 :]}
    world = make_world(bodies, [Plane.ground()], Law(0.3, 0.0), laws=apart)
    return Lab(world, Scheme(dt=dt, sweeps=20))


def energies(count: int, speed: float, dt: float) -> Array:
    """The energy after each step [J], of a ball that hits the first domino."""
    start = {"ball.position": [-0.05, 0, RADIUS], "ball.velocity": [speed, 0, 0]}
    start |= {f"d{k}.position": [k * APART, 0, HALF[2]] for k in range(count)}
    lab = row(count, dt)
    return energy(lab.world, lab.states(start, 0.5))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "dt", "speeds"),
    [
        (4, 0.01, (1.2, 1.6)),
        *(thorough(*each, tuple(np.linspace(1, 3, 21))) for each in ((4, 0.01), (4, 0.0025), (8, 0.005))),
    ],
)
def test_no_step_adds_energy(count: int, dt: float, speeds: tuple[float, ...]) -> None:
    """Beyond what sweeps that have not settled miss. Newton's method solves four dominoes together, eight are swept."""
    for speed in speeds:
        found = energies(count, speed, dt)
        assert np.diff(found).max() < 3e-4 * found[0], speed
