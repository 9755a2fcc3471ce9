"""Scenes of boxes, capsules and balls for both engines, with a batch of initial states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from symphys.model.shapes import Box, Capsule, Plane, Sphere
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, World, make_world
from symphys.types import Array

KINDS = ("sphere", "capsule", "box")
"""MuJoCo's names of solids with one, two and three sizes."""


@dataclass(frozen=True)
class Solid:
    """A box, a capsule or a ball.

    Attributes:
        name: of the body.
        mass: [kg].
        sizes: half edges (3,) of a box, radius and half length (2,) of a capsule, or radius (1,) of a ball [m].
    """

    name: str
    mass: float
    sizes: tuple[float, ...]

    @property
    def inertia(self) -> tuple[float, ...]:
        """Return the principal moments about the centre [kg m^2] for uniform density."""
        if len(self.sizes) == 3:
            squares = np.square(self.sizes)
            return tuple(float(m) for m in self.mass / 3 * (squares.sum() - squares))
        radius, half = (*self.sizes, 0.0)[:2]
        tube, ends = 2 * half, 4 / 3 * radius  # cylinder and the two half balls, as lengths of the same section
        m, n = self.mass * tube / (tube + ends), self.mass * ends / (tube + ends)
        across = m * (radius**2 / 4 + half**2 / 3) + n * (0.4 * radius**2 + half**2 + 0.75 * half * radius)
        return across, across, (m / 2 + 0.4 * n) * radius**2

    def body(self) -> Body:
        """Return the body for this engine."""
        shapes = {1: lambda r: Sphere(r), 2: Capsule, 3: lambda *sizes: Box(sizes)}
        return Body(self.name, self.mass, self.inertia, (shapes[len(self.sizes)](*self.sizes),))

    def xml(self, contact: str) -> str:
        """Return the body for MuJoCo, with the same mass and inertia."""
        kind, sizes = KINDS[len(self.sizes) - 1], " ".join(map(str, self.sizes))
        moments = " ".join(map(str, self.inertia))
        return (
            f'<body name="{self.name}"><freejoint/><inertial pos="0 0 0" mass="{self.mass}" diaginertia="{moments}"/>'
            f'<geom type="{kind}" size="{sizes}" {contact}/></body>'
        )


@dataclass(frozen=True)
class Scene:
    """Solids above the ground, and a batch of initial states.

    Attributes:
        name: of the scene.
        solids: the bodies.
        start: (batch, solids, 13) position, orientation w x y z, velocity, angular velocity (world frame).
        friction: coefficient of all contacts.
        gravity: downwards [m/s^2].
    """

    name: str
    solids: tuple[Solid, ...]
    start: Array
    friction: float = 0.5
    gravity: float = 9.81

    def world(self, restitution: float = 0.0) -> World:
        """Return the world for this engine."""
        bodies, law = [solid.body() for solid in self.solids], Law(self.friction, restitution)
        return make_world(bodies, [Plane.ground()], law, (0, 0, -self.gravity))

    def states(self, world: World) -> Array:
        """Return the initial states (batch, nx) for this engine."""
        return np.array([np.array(ca.DM(initial_state(world, self.values(row)))).ravel() for row in self.start])

    def values(self, row: Any) -> dict[str, Any]:
        """Return an initial state by name, from (solids, 13) numbers or, for one solid, a casadi column of 13."""
        row = row if isinstance(row, np.ndarray) else [row]
        parts = {"position": slice(0, 3), "orientation": slice(3, 7)}
        parts |= {"velocity": slice(7, 10), "angular_velocity": slice(10, 13)}
        pairs = zip(self.solids, row, strict=True)
        return {f"{solid.name}.{name}": body[part] for solid, body in pairs for name, part in parts.items()}

    def places(self, world: World, X: Array) -> Array:
        """Return the centres (..., solids, 3) of states (..., nx) of this engine."""
        layout = Layout(world)
        return np.stack([X[..., layout[f"{solid.name}.position"]] for solid in self.solids], axis=-2)


def turned(rng: np.random.Generator, count: int) -> Array:
    """Return random orientations (count, 4)."""
    q = rng.standard_normal((count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def tumbling_box(batch: int = 8) -> Scene:
    """Return a flat box that is thrown on the ground, turning."""
    rng = np.random.default_rng(1)
    start = np.zeros((batch, 1, 13))
    start[:, 0, :3] = [0, 0, 0.6]
    start[:, 0, 3:7] = turned(rng, batch)
    start[:, 0, 7:10] = [1, 0.5, 0]
    start[:, 0, 10:] = rng.uniform(-6, 6, (batch, 3))
    return Scene("box", (Solid("box", 1.0, (0.2, 0.15, 0.1)),), start)


def heap_of_capsules(side: int = 2, batch: int = 8) -> Scene:
    """Return ``side`` cubed capsules in a grid, turned at random, that fall on the ground and on each other."""
    rng, step = np.random.default_rng(2), 0.26
    grid = np.stack(np.meshgrid(*3 * [np.arange(side) * step], indexing="ij"), axis=-1).reshape(-1, 3)
    count = len(grid)
    start = np.zeros((batch, count, 13))
    start[:, :, :3] = grid - (side - 1) * step / 2 * np.array([1, 1, 0]) + [0, 0, 0.2]
    start[:, :, 3:7] = turned(rng, batch * count).reshape(batch, count, 4)
    start[:, :, 7:10] = [0, 0, -1]
    start[:, :, 10:] = rng.uniform(-2, 2, (batch, count, 3))
    solids: Sequence[Solid] = [Solid(f"c{i}", 1.0, (0.05, 0.07)) for i in range(count)]
    return Scene("heap", tuple(solids), start)
