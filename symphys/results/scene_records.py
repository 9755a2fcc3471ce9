"""What stands around a motion and what moves in it, as scene.json has it: frozen records."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from symphys.results.joint_records import SceneJoint
from symphys.results.records import Array

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
THREE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Solid:
    """All points within ``radius`` of an inner box: a sphere, whose box is a point, a capsule, a line, or a box.

    Attributes:
        radius: [m]; 0 for a box.
        half: (3,) half sizes of the inner box along its own axes [m].
        centre: (3,) [m], in the body's frame; in the world for what stands still.
        orientation: (4,) unit quaternion w x y z.
    """

    radius: float = 0.0
    half: Array = field(default_factory=lambda: np.zeros(3))
    centre: Array = field(default_factory=lambda: np.zeros(3))
    orientation: Array = field(default_factory=lambda: np.array(UPRIGHT))

    @property
    def girth(self) -> float:
        """The smallest half size [m]."""
        return self.radius or float(self.half.min())

    @property
    def reach(self) -> float:
        """From the origin to the farthest point, at most [m]."""
        return float(np.linalg.norm(self.centre) + np.linalg.norm(self.half)) + self.radius

    @property
    def is_ball(self) -> bool:
        """Whether it is a sphere, or a point."""
        return not self.half.any()


@dataclass(frozen=True)
class SceneBody:
    """A body's name, the solids of its surface, and its mass [kg]; nan where it is not known."""

    name: str
    solids: tuple[Solid, ...]
    mass: float = np.nan


@dataclass(frozen=True)
class ScenePlane:
    """A static half space {x: normal . x < offset}; ``normal`` (3,) of length 1, ``offset`` [m]."""

    name: str
    normal: Array
    offset: float


@dataclass(frozen=True)
class SceneFixture:
    """A static solid, placed in the world."""

    name: str
    solid: Solid


@dataclass(frozen=True)
class SceneTerrain:
    """Heights ``z`` (rows, columns) of the ground at ``y`` (rows,), ``x`` (columns,) [m]; nan where there is none."""

    name: str
    x: Array
    y: Array
    z: Array


@dataclass(frozen=True)
class Scene:
    """What is drawn around and for the states of a trajectory; ``gravity`` is its size [m/s^2], nan if not known."""

    bodies: tuple[SceneBody, ...] = ()
    planes: tuple[ScenePlane, ...] = ()
    fixtures: tuple[SceneFixture, ...] = ()
    terrain: tuple[SceneTerrain, ...] = ()
    joints: tuple[SceneJoint, ...] = ()
    gravity: float = np.nan

    def solids(self, name: str) -> tuple[Solid, ...]:
        """The surface of the body called ``name``; none if the scene does not know it."""
        return next((body.solids for body in self.bodies if body.name == name), ())
