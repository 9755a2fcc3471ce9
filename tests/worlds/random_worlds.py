"""Random scenes of two bodies among static surfaces: awkward ones more often than chance would have it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.functions import step_function
from symphys.model.shapes import Box, Capsule, Fixture, Plane, Shape, Sphere, Static, Terrain
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

SMOOTHINGS = (0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0)
QUARTER = np.sqrt(0.5)
TURNS = np.array(
    [(1, 0, 0, 0), (QUARTER, QUARTER, 0, 0), (QUARTER, 0, QUARTER, 0), (QUARTER, 0, 0, QUARTER), (0.5, 0.5, 0.5, 0.5)]
)
"""Orientations in which edges and faces lie along each other."""
KINDS = ("sphere", "capsule", "box")
LAWS = ("hard", "spins", "soft")
STATICS: dict[str, Static] = {
    "ground": Plane.ground(),
    "slab": Fixture("slab", Box((1.0, 1.0, 0.25), (0, 0, -0.25))),
    "post": Fixture("post", Capsule(0.2, 0.5, (0, 0, -0.2), (QUARTER, 0, QUARTER, 0))),
    "hills": Terrain("hills", lambda x, y: 0.1 * ca.sin(3 * x) * ca.cos(2 * y)),
}
STRUCTURES = (
    ("sphere", "capsule", "hills", "spins"),
    ("capsule", "capsule", "slab", "hard"),
    ("capsule", "box", "ground", "spins"),
    ("sphere", "box", "post", "soft"),
    ("box", "box", "ground", "hard"),
    ("box", "box", "slab", "hard"),
    ("box", "capsule", "hills", "hard"),
    ("capsule", "box", "post", "soft"),
    ("sphere", "sphere", "slab", "spins"),
    ("box", "sphere", "ground", "hard"),
)
"""Kinds of the two bodies, what is static, and the kind of law."""


@dataclass(frozen=True)
class Lot:
    """A world whose numbers are parameters: sizes (3 each), a shape's offset (3), mass, friction, restitution."""

    layout: Layout
    world: World
    derivatives: ca.Function
    """(x, p, smoothing) -> x', gradient of a weighted sum of x' by (x, p, smoothing)."""


def shape(kind: str, size: Any, centre: Any) -> Shape:
    """Of symbols."""
    place = tuple(centre[i] for i in range(3))
    if kind == "sphere":
        return Sphere(size[0], place)
    return Capsule(size[0], size[1], place) if kind == "capsule" else Box(tuple(size[i] for i in range(3)), place)


@cache
def lot(first: str, second: str, static: str, law: str, cuts: int | None = None) -> Lot:
    """A world and its derivatives."""
    size_a, size_b, centre, numbers = ca.SX.sym("a", 3), ca.SX.sym("b", 3), ca.SX.sym("c", 3), ca.SX.sym("n", 3)
    mass, friction, restitution = ca.vertsplit(numbers)
    laws = {
        "hard": Law(friction, restitution),
        "spins": Law(friction, restitution, torsion=0.01, rolling=0.01),
        "soft": Law(friction, 0.0, frequency=5.0),
    }
    bodies = [
        Body("a", mass, (0.02, 0.03, 0.04), (shape(first, size_a, centre),)),
        Body("b", 1.0, 0.03, (shape(second, size_b, ca.SX.zeros(3)),)),
    ]
    world = make_world(bodies, [STATICS[static]], laws[law])
    step = step_function(world, Scheme(sweeps=3, cuts=cuts), parameters=[size_a, size_b, centre, numbers])
    x, p, smoothing = ca.SX.sym("x", step.size1_in(0)), ca.SX.sym("p", 12), ca.SX.sym("s")
    after = step(x, ca.DM(0, 1), p, smoothing)
    weighted = ca.dot(after, ca.DM(np.linspace(1, 2, after.numel())))
    slope = ca.gradient(weighted, ca.vertcat(x, p, smoothing))
    return Lot(Layout(world), world, ca.Function("d", [x, p, smoothing], [after, ca.densify(slope)]))


def draw(rng: np.random.Generator, world: World) -> tuple[Array, Array, float]:
    """(x, p, smoothing): poses that are random, snapped to a grid, stacked, or the same for both."""
    sizes = rng.uniform(0.05, 0.4, 6) if rng.random() < 0.5 else rng.choice([0.1, 0.2, 0.3], 6)
    centre = rng.choice([0, 1]) * rng.uniform(-0.2, 0.2, 3)
    p = np.concatenate([sizes, centre, [rng.uniform(0.2, 5), rng.choice([0, 0.5, 1.0]), rng.choice([0, 0.5, 1.0])]])
    poses = [pose(rng, sizes[3 * k : 3 * k + 3]) for k in range(2)]
    if rng.random() < 0.15:
        poses[1] = poses[0]
    elif rng.random() < 0.2:
        poses[1] = poses[0][0] + [0, 0, sizes[2] + sizes[5]], poses[0][1]
    values = {}
    for name, (position, orientation) in zip("ab", poses, strict=True):
        values |= {f"{name}.position": position, f"{name}.orientation": orientation}
        values |= {f"{name}.velocity": motion(rng, 2.0), f"{name}.angular_velocity": motion(rng, 10.0)}
    return np.array(initial_state(world, values)).ravel(), p, float(rng.choice(SMOOTHINGS))


def pose(rng: np.random.Generator, size: Array) -> tuple[Array, Array]:
    """Position and orientation."""
    orientation = rng.normal(size=4) if rng.random() < 0.4 else TURNS[rng.integers(len(TURNS))]
    position = rng.uniform(-0.6, 0.6, 3)
    if rng.random() < 0.5:
        position = np.round(position, 1)
    if rng.random() < 0.5:
        position[2] = size[rng.integers(3)]
    return position, orientation / np.linalg.norm(orientation)


def motion(rng: np.random.Generator, most: float) -> Array:
    """A velocity: often none, along an axis, or next to nothing."""
    direction = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[rng.integers(3)]
    return np.asarray(rng.choice([0.0, 0.0, 1e-9, 1.0, most]) * direction)


def steps(
    structure: tuple[str, str, str, str], seed: int, count: int, cuts: int | None = None
) -> Iterator[tuple[int, Array, Array]]:
    """(scene, x', slope) of three steps from each of ``count`` scenes."""
    parts, rng = lot(*structure, cuts), np.random.default_rng(seed)
    for k in range(count):
        x, p, smoothing = draw(rng, parts.world)
        for _ in range(3):
            after, slope = (np.array(part).ravel() for part in parts.derivatives(x, p, smoothing))
            yield k, after, slope
            x = after
