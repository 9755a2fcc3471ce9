"""Heavy bodies on light ones: sweeps go slowly where masses differ, and longer steps reach the answer."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few, thorough

from symphys.dynamics.functions import step_function
from symphys.dynamics.pgs import clusters
from symphys.dynamics.prediction import bodies_of
from symphys.dynamics.unknowns import PlacedConstraint
from symphys.model.shapes import Box, Plane
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, Scheme, World, make_world

SIZE, TIME = 0.2, 0.6


def ball(name: str, mass: float) -> Body:
    """0.2 m across."""
    return Body.ball(name, SIZE / 2, mass)


def cube(name: str, mass: float) -> Body:
    """Of 0.2 m."""
    return Body(name, mass, mass * SIZE**2 / 6, (Box((SIZE / 2,) * 3),))


@cache
def rolled(kind: Callable[[str, float], Body], masses: tuple[float, ...]) -> tuple[World, ca.Function]:
    """A stack, and its motion over ``TIME``."""
    world, scheme = stack(kind, list(masses)), Scheme()
    return world, step_function(world, scheme).mapaccum(round(TIME / scheme.dt))


def stack(kind: Callable[[str, float], Body], masses: list[float]) -> World:
    """One on the other on the ground, the first at the bottom."""
    return make_world([kind(f"b{k}", mass) for k, mass in enumerate(masses)], [Plane.ground()], Law(0.5, 0.0))


def heights(kind: Callable[[str, float], Body], masses: tuple[float, ...], drop: float) -> tuple[np.ndarray, float]:
    """How far each body is from its place at the end [m], and the fastest velocity [m/s]; dropped from ``drop`` [m]."""
    world, rollout = rolled(kind, masses)
    layout, count = Layout(world), len(masses)
    start = {f"b{k}.position": [0, 0, SIZE / 2 + k * SIZE + drop * (k + 1)] for k in range(count)}
    more = (ca.DM.zeros(n, rollout.size2_in(3)) for n in (0, 0, 1))
    end = np.array(rollout(initial_state(world, start), *more))[:, -1]
    places = np.array([end[layout[f"b{k}.position"]] for k in range(count)])
    speeds = [np.abs(end[layout[f"b{k}.velocity"]]).max() for k in range(count)]
    return places[:, 2] - SIZE / 2 - SIZE * np.arange(count), max(speeds)


@pytest.mark.slow
@few(("kind", "ratio", "depth"), [(ball, 1e3, 1e-9), (ball, 1e4, 1e-7), thorough(cube, 1e2, 1e-4)], 1)
@few("drop", [0.0, 0.02], 1)
def test_a_light_body_carries_a_heavy_one(kind: Callable[[str, float], Body], ratio: float, depth: float, drop: float):
    """Statics, at the default sweeps: nobody sinks."""
    off, speed = heights(kind, (1.0, ratio), drop)
    assert np.abs(off).max() < depth
    assert speed < 1e-3


@pytest.mark.slow
def test_a_tower_that_grows_heavier() -> None:
    """1, 10, 100 and 1,000 kg."""
    off, speed = heights(ball, (1.0, 10.0, 100.0, 1000.0), 0.0)
    assert np.abs(off).max() < 1e-6
    assert speed < 1e-6


def rows(world: World) -> list[PlacedConstraint]:
    """One for each pair, without what it is made of."""
    return [PlacedConstraint(bodies_of(pair), None, bodies_of(pair)) for pair in world.pairs]


def test_only_bodies_that_differ_in_mass_are_treated_so() -> None:
    """Where all masses are alike plain sweeps do, and a body alone leans on nobody."""

    def found(masses: list[float]) -> list[tuple[int, ...]]:
        world = stack(ball, masses)
        return [cluster.bodies for cluster in clusters(world, rows(world))]

    assert found([1.0, 2.0]) == []
    assert found([1.0]) == []
    assert found([1.0, 100.0]) == [(0, 1)]
    assert found([1.0, ca.SX.sym("m")]) == [(0, 1)]
