"""Shapes: parts of a body's surface, and the static surfaces of a world.

Everything here is frozen. A number may be a float or a casadi symbol. SI units. A shape of a body is placed in the
body's frame, from its centre of mass; a static one in world coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Scalar = Any
"""float or casadi.SX"""
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
"""The quaternion of no rotation."""


@dataclass(frozen=True)
class Sphere:
    """A ball.

    Attributes:
        radius: [m].
        centre: (3,) [m].
    """

    radius: Scalar
    centre: tuple[Scalar, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Capsule:
    """A cylinder with round ends: all points within ``radius`` of a segment along its own z axis.

    Attributes:
        radius: [m].
        half_length: of the segment, from the centre to the centre of a round end [m].
        centre: (3,) [m].
        orientation: (4,) unit quaternion w x y z.
    """

    radius: Scalar
    half_length: Scalar
    centre: tuple[Scalar, ...] = (0.0, 0.0, 0.0)
    orientation: tuple[Scalar, ...] = UPRIGHT


@dataclass(frozen=True)
class Box:
    """A rectangular block.

    Attributes:
        half_sizes: (3,) [m], along its own axes.
        centre: (3,) [m].
        orientation: (4,) unit quaternion w x y z.
    """

    half_sizes: tuple[Scalar, ...]
    centre: tuple[Scalar, ...] = (0.0, 0.0, 0.0)
    orientation: tuple[Scalar, ...] = UPRIGHT


@dataclass(frozen=True)
class Plane:
    """A static half space {x: normal . x < offset}; bodies stay on the other side.

    Attributes:
        name: how formulas and pairs refer to it.
        normal: (3,) unit vector, out of the solid.
        offset: [m].
    """

    name: str
    normal: tuple[Scalar, ...] = (0.0, 0.0, 1.0)
    offset: Scalar = 0.0

    @classmethod
    def ground(cls, height: Scalar = 0.0) -> Plane:
        """The floor: everything below ``height`` is solid."""
        return cls("ground", offset=height)


@dataclass(frozen=True)
class Fixture:
    """A static shape: a ramp, a wall with an end, a post, a step.

    Attributes:
        name: how formulas and pairs refer to it.
        shape: placed in world coordinates.
    """

    name: str
    shape: Shape


@dataclass(frozen=True)
class Terrain:
    """Static ground of varying height: everything below the surface z = height(x, y) is solid.

    Attributes:
        name: how formulas and pairs refer to it.
        height: of casadi scalars x, y [m], world frame; twice differentiable.
    """

    name: str
    height: Callable[[Any, Any], Any]


Shape = Sphere | Capsule | Box
Static = Plane | Fixture | Terrain
Surface = Shape | Plane | Terrain

POINTS: dict[tuple[type, type], int] = {
    (Sphere, Plane): 1,
    (Capsule, Plane): 2,
    (Box, Plane): 8,
    (Sphere, Terrain): 1,
    (Capsule, Terrain): 2,
    (Box, Terrain): 8,
    (Sphere, Sphere): 1,
    (Sphere, Capsule): 1,
    (Sphere, Box): 1,
    (Capsule, Capsule): 5,
    (Capsule, Box): 8,
    (Box, Box): 16,
}
"""In how many points two surfaces may touch at once: one candidate for each is looked at in every step."""


def surface(static: Static) -> Surface:
    """What a static part of the world is made of."""
    return static.shape if isinstance(static, Fixture) else static


def contact_points(a: Surface, b: Surface) -> int:
    """The candidates of a pair of surfaces, in either order; 0 if no rule covers it."""
    return POINTS.get((type(a), type(b))) or POINTS.get((type(b), type(a))) or 0
