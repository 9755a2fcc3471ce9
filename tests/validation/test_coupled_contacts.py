"""Contacts whose friction acts strongly on their normal velocity: one contact is solved to Coulomb's law."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few

from symphys.dynamics.contact.coupling import may_couple
from symphys.dynamics.functions import report_function
from symphys.model.shapes import Box, Capsule, Plane, Sphere
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, Scheme, World, make_world

HALF, RADIUS, INERTIA, SMALL = 0.5, 0.01, 1 / 12, 1e-6
SHARE = 5 / 6
"""Of a step's impulse in the first step of leapfrog with two cuts: its first stretch begins with half a kick."""


@cache
def first_step(dt: float) -> tuple[World, ca.Function]:
    """A slender rod, 1 kg and 1 m, on the ground; (x, u, friction, smoothing) -> what its first step reports."""
    friction = ca.SX.sym("friction")
    rod = Body("rod", 1.0, (INERTIA, INERTIA, 1e-4), (Capsule(RADIUS, HALF),))
    world = make_world([rod], [Plane.ground()], Law(friction, 0.0))
    return world, report_function(world, Scheme(dt=dt, sweeps=20), parameters=[friction])


def reported(start: dict[str, Any], friction: float, dt: float) -> dict[str, np.ndarray]:
    """By name."""
    world, step = first_step(dt)
    found = step.call({"x": initial_state(world, start), "u": ca.DM(0, 1), "p": friction, "smoothing": 0})
    return {name: np.array(value).ravel() for name, value in found.items()}


def sliding(friction: float, angle_deg: float, leading: bool) -> dict[str, np.ndarray]:
    """What a rod that slides at 2 m/s on its lower tip reports of its first step."""
    angle = np.radians(angle_deg)
    half = (np.pi / 2 - angle) / 2 * (-1 if leading else 1)
    start = {
        "rod.position": [0, 0, HALF * np.sin(angle) + RADIUS],
        "rod.orientation": [np.cos(half), 0, np.sin(half), 0],
        "rod.velocity": [2, 0, 0],
    }
    return reported(start, friction, SMALL)


def pressing(friction: float, angle_deg: float, sign: int) -> float:
    """[N]: m g / (1 + (rx^2 +- mu rx rz) / I), of a tip that trails (+) or leads (-) (Painleve 1895)."""
    angle = np.radians(angle_deg)
    rx, rz = HALF * np.cos(angle), HALF * np.sin(angle) + RADIUS
    return 9.81 / (1 + (rx * rx + sign * friction * rx * rz) / INERTIA)


@pytest.mark.slow
@few("friction", [1.2, 1.4, 2.0, 3.0], 1)
def test_the_tip_of_a_rod_that_trails(friction: float) -> None:
    """No paradox there, at any friction; the last sweep changes nothing."""
    for angle in (30, 45, 60, 70, 80):
        found = sliding(friction, angle, leading=False)
        assert found["forces"][2::3].sum() / SHARE == pytest.approx(pressing(friction, angle, 1), rel=1e-4)
        assert found["residual"][0] < 1e-9 * 9.81 * SMALL
        assert found["paradox"][0] == 0


@pytest.mark.parametrize("friction", [0.3, 0.6, 1.0])
def test_the_tip_of_a_rod_that_leads(friction: float) -> None:
    """Below the critical friction the law has one solution, which presses more the nearer it is."""
    for angle in (30, 45, 60, 70, 80):
        found = sliding(friction, angle, leading=True)
        assert found["forces"][2::3].sum() / SHARE == pytest.approx(pressing(friction, angle, -1), rel=1e-3)
        assert found["residual"][0] < 1e-9 * 9.81 * SMALL


def test_beyond_the_critical_friction_the_paradox_is_named() -> None:
    """(rx^2 - mu rx rz) / I < -1: a sliding force would pull the tip into the ground. It sticks at once."""
    found = sliding(2.0, 60, leading=True)
    assert pressing(2.0, 60, -1) < 0
    assert found["paradox"][0] == 1
    after, layout = found["x_next"], Layout(first_step(SMALL)[0])
    spin, velocity = after[layout["rod.angular_velocity"]], after[layout["rod.velocity"]]
    tip = velocity[0] + spin[1] * -(HALF * np.sin(np.radians(60)) + RADIUS)
    assert abs(tip) < 0.02 * 2


@pytest.mark.parametrize("seed", range(40))
def test_one_contact_is_solved_within_twenty_sweeps(seed: int) -> None:
    """A tilted rod that lands on its tip in any direction: stick or slip, the last of 20 sweeps changes nothing."""
    rng = np.random.default_rng(seed)
    tilt, turn = rng.uniform(0.1, 1.3), rng.uniform(0, 2 * np.pi)
    axis = np.array([np.cos(turn), np.sin(turn), 0]) * np.sin(tilt / 2)
    start = {
        "rod.position": [0, 0, HALF * np.cos(tilt) + RADIUS],
        "rod.orientation": [np.cos(tilt / 2), *axis],
        "rod.velocity": [*rng.uniform(-2, 2, 2), rng.uniform(-2, -1)],
        "rod.angular_velocity": rng.uniform(-1, 1, 3).tolist(),
    }
    found = reported(start, float(rng.uniform(0.1, 1.0)), 0.01)
    assert found["residual"][0] < 1e-9 * np.abs(found["forces"]).max() * 0.01


def test_only_contacts_that_may_couple_are_solved_so() -> None:
    """Balls about their centres never do, a cube does beyond mu of about 1.9, and what symbols decide may."""
    ball, cube = Body.ball("ball", 0.1, 1.0), Body("cube", 1.0, 1 / 6, (Box((0.5, 0.5, 0.5)),))
    off = Body("off", 1.0, 1.0, (Sphere(0.1, (0.0, 0.0, 5.0)),))

    def of(body: Body, friction: object) -> bool:
        world = make_world([body], [Plane.ground()], Law(friction))
        return may_couple(world, world.pairs[0])

    assert [of(ball, 9.0), of(cube, 0.5), of(cube, 2.0), of(cube, 0.0)] == [False, False, True, False]
    assert [of(off, 1.0), of(cube, ca.SX.sym("mu")), of(ball, ca.SX.sym("mu"))] == [True, True, False]
