"""The worlds of the ablation: a cushion, a spinning box, boxes at rest, in a stack and on a slope."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
from scenes import Scene, Solid, turned

from symphys.model.shapes import Plane
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Law, Pair, World, make_world
from symphys.types import Array

RADIUS = 0.0286
BOX = Solid("box", 1.0, (0.2, 0.15, 0.1))


def billiard() -> World:
    """A ball on cloth, mu = 0.2, and a frictionless cushion at x = 1, e = 0.8."""
    planes = [Plane.ground(), Plane("cushion", (-1.0, 0, 0), -1.0)]
    world = make_world([Solid("ball", 0.17, (RADIUS,)).body()], planes)
    ground, wall = world.pairs
    floor = Pair("floor", ground.first, ground.second, Law(0.2))
    return World(world.bodies, world.statics, (floor, Pair("side", wall.first, wall.second, Law(0.0, 0.8))))


def spinning_box(batch: int = 16) -> Scene:
    """A box above the ground, turned at random and spinning."""
    rng, start = np.random.default_rng(4), np.zeros((batch, 1, 13))
    start[:, 0, 2] = 0.5
    start[:, 0, 3:7] = turned(rng, batch)
    start[:, 0, 7:10] = [1, 0.5, -2]
    start[:, 0, 10:] = rng.uniform(-4, 4, (batch, 3))
    return Scene("corner", (BOX,), start, 0.3)


def bouncing_box(batch: int = 16) -> Scene:
    """A box that is thrown on the ground, turned at random."""
    return replace(spinning_box(batch), name="bounce", friction=0.5)


def mechanical_energy(world: World, states: Array) -> Array:
    """Kinetic and potential energy [J] of all bodies of a world, from (..., nx) states."""
    layout, total = Layout(world), np.zeros(states.shape[:-1])
    for body in world.bodies:
        q = states[..., layout[f"{body.name}.orientation"]]
        spin = states[..., layout[f"{body.name}.angular_velocity"]]
        w, axis = q[..., :1], q[..., 1:]
        twice = 2 * np.cross(axis, spin)
        own = spin - w * twice + np.cross(axis, twice)
        kinetic = body.mass * (states[..., layout[f"{body.name}.velocity"]] ** 2).sum(-1)
        height = states[..., layout[f"{body.name}.position"]] @ np.array(world.gravity)
        total += (kinetic + (own**2 * body.inertia).sum(-1)) / 2 - body.mass * height
    return total


def spinning_ball(batch: int = 16) -> Scene:
    """A ball above the ground with spin about every axis, in leaning gravity."""
    rng, start = np.random.default_rng(6), np.zeros((batch, 1, 13))
    start[:, 0, 2], start[:, 0, 3] = 1, 1
    start[:, 0, 7:9] = [0.5, -0.3]
    start[:, 0, 10:] = rng.uniform(-60, 60, (batch, 3))
    return Scene("spin", (Solid("ball", 1.0, (0.1,)),), start, 0.3, lean=3.0)


def resting_box() -> tuple[World, Array]:
    """A box on the ground that is given 0.1 m/s and a little spin."""
    world = make_world([BOX.body()], [Plane.ground()], Law(0.5))
    start = {"box.position": [0, 0, 0.1], "box.velocity": [0.1, 0.05, 0], "box.angular_velocity": [0, 0, 0.2]}
    return world, np.array(ca.DM(initial_state(world, start))).T


def sliding_crate() -> tuple[World, Array]:
    """A box that is pushed along and turns."""
    world = make_world([BOX.body()], [Plane.ground()], Law(0.3))
    start = {"box.position": [0, 0, 0.1], "box.velocity": [2.4, 0.27, 0], "box.angular_velocity": [0, 0, 2.67]}
    return world, np.array(ca.DM(initial_state(world, start))).T


def slabs(count: int = 5) -> World:
    """Boxes that may touch their neighbours only; the lowest the ground."""
    solids = [Solid(f"s{i}", 1.0, (0.2, 0.15, 0.1)) for i in range(count)]
    world = make_world([solid.body() for solid in solids], [Plane.ground()], Law(0.5))
    near = lambda p: (p.second.body is None and p.first.body == 0) or p.second.body == p.first.body + 1  # noqa: E731
    return World(world.bodies, world.statics, tuple(pair for pair in world.pairs if near(pair)))


def slabs_start(world: World, gap: float = 0.01) -> Array:
    """Above each other with gaps, each a little aside and turned."""
    start = {}
    for i, body in enumerate(world.bodies):
        start[f"{body.name}.position"] = [0.01 * (-1) ** i, 0.005 * i, 0.1 + gap + (0.2 + gap) * i]
        start[f"{body.name}.orientation"] = [np.cos(0.05 * i), 0, 0, np.sin(0.05 * i)]
    return np.array(ca.DM(initial_state(world, start))).ravel()


def inclined(share: float, mu: float = 0.6) -> tuple[World, Array]:
    """A box on a slope whose angle has ``share`` of the tangent at which it slides; gravity leans."""
    angle = np.arctan(share * mu)
    gravity = (9.81 * np.sin(angle), 0.0, -9.81 * np.cos(angle))
    world = make_world([BOX.body()], [Plane.ground()], Law(mu), gravity)
    return world, np.array(ca.DM(initial_state(world, {"box.position": [0, 0, 0.1]}))).T
