"""scene.json: the part of a world that pictures of a motion need. Frozen records, their writing and their reading.

What cannot be read, or is too large to draw, is left out of the picture.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, field
from pathlib import Path
from typing import Any

import numpy as np

from symphys import json_values as values
from symphys.json_values import Text
from symphys.model.shapes import SHAPES
from symphys.records import dataclass
from symphys.results.drawable import MAX_DRAWABLE, small
from symphys.results.polytope import Polytope, make_polytope
from symphys.results.scene_joints import SceneJoint
from symphys.results.text_files import read_table
from symphys.types import Array

KINDS = "bodies", "planes", "fixtures", "terrain", "joints", "contacts", "marks"
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Solid:
    """The points within ``radius`` of the convex hull of some corners, as a ``RoundedHull``.

    Attributes:
        radius: [m].
        corners: (k, 3) [m], from its centre, along its own axes; one for a ball, two for a capsule.
        centre: (3,) [m], in the body's frame; in the world for what stands still.
        orientation: (4,) unit quaternion w x y z.
        kind: of the shape, as problem files call it.
        sizes: of the shape, by the names of problem files: a number, (3,) or points (n, 3) [m].
    """

    radius: float = 0.0
    corners: Array = field(default_factory=lambda: np.zeros((1, 3)))
    centre: Array = field(default_factory=lambda: np.zeros(3))
    orientation: Array = field(default_factory=lambda: np.array(UPRIGHT))
    kind: str = "sphere"
    sizes: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, kind: str, sizes: Mapping[str, Any], centre: Array, orientation: Array) -> Solid:
        """Return the solid that a shape of this kind draws."""
        whole = {key: tuple(size) if isinstance(size, np.ndarray) else size for key, size in sizes.items()}
        hull = SHAPES[kind].from_sizes(whole, tuple(centre), UPRIGHT).rounded_hull
        return cls(hull.radius, np.array(hull.corners, float), centre, orientation, kind, sizes)

    @property
    def polytope(self) -> Polytope:
        """Return the faces and edges of the hull of its corners."""
        return make_polytope(tuple(map(tuple, self.corners.tolist())))

    @property
    def half(self) -> Array:
        """Return the half sizes (3,) [m] of the box about its centre, along its own axes, that holds its corners."""
        return np.asarray(np.abs(self.corners).max(axis=0))

    @property
    def girth(self) -> float:
        """Return the distance [m] from its centre to the nearest point of its surface."""
        return self.radius + self.polytope.inradius

    @property
    def reach(self) -> float:
        """Return the distance [m] from the origin to its farthest point, at most."""
        return float(np.linalg.norm(self.centre) + np.linalg.norm(self.corners, axis=1).max()) + self.radius

    @property
    def is_ball(self) -> bool:
        """Whether it is a sphere, or a point."""
        return len(self.corners) == 1

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``shapes``: kind, sizes as in problem files, centre and, unless round, orientation."""
        sizes = {key: size.tolist() if isinstance(size, np.ndarray) else size for key, size in self.sizes.items()}
        turned = {"orientation": self.orientation.tolist()} if SHAPES[self.kind].turns else {}
        return {"kind": self.kind, **sizes, "centre": self.centre.tolist(), **turned}

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> Solid | None:
        """Read an entry of ``shapes``; None if it has no size and place that can be drawn."""
        entry = values.table(value)
        kind, centre = str(entry.get("kind", "sphere")), values.vector(entry.get("centre"))
        if kind not in SHAPES:
            return None
        keys = {key.name: key.count for key in SHAPES[kind].size_keys}
        sizes = {name: SIZES[count](entry.get(name)) for name, count in keys.items()}
        lengths = [size for name, size in sizes.items() if keys[name]]
        optional = [key.name for key in SHAPES[kind].optional_keys if key.name in entry]
        sizes |= {name: values.number(entry[name]) for name in optional}
        whole = np.concatenate([np.ravel(size) for size in sizes.values()])
        if not (whole.size and small([*whole, *centre]) and all(np.all(length > 0) for length in lengths)):
            return None
        if not lengths and SHAPES[kind].from_sizes(sizes, (0.0, 0.0, 0.0), UPRIGHT).flatness:
            return None
        return cls.of(kind, sizes, centre, _orientation(entry.get("orientation")))


def _points(value: object) -> Array:
    """Read a list of lists as points (n, 3); nan for numbers that are missing."""
    rows = [values.vector(row, np.nan) for row in value] if isinstance(value, list) else []
    return np.array(rows, float).reshape(-1, 3)


SIZES: dict[int, Callable[[object], Any]] = {0: _points, 1: values.number, 3: values.vector}
"""Readers of a size, by its ``SizeKey.count``."""


def _orientation(value: object) -> Array:
    """Read a unit quaternion (4,); no rotation for anything that is none."""
    read = values.numbers(value)
    length = float(np.linalg.norm(read)) if read.size == 4 else 0.0
    return read / length if 0 < length < np.inf else np.array(UPRIGHT)


@dataclass(frozen=True)
class SceneBody:
    """A body's name, the solids of its surface (``shapes`` in the file), and its mass [kg]; nan if it is not known."""

    name: str
    solids: tuple[Solid, ...] = field(metadata={"key": "shapes"})
    mass: float = np.nan

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``bodies``."""
        return {"name": self.name, "mass": self.mass, "shapes": [solid.to_json() for solid in self.solids]}


@dataclass(frozen=True)
class ScenePlane:
    """A static half space {x: normal . x < offset}; ``normal`` (3,) of length 1, ``offset`` [m]."""

    name: str
    normal: Array
    offset: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``planes``."""
        return {"name": self.name, "normal": self.normal.tolist(), "offset": self.offset}

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> ScenePlane | None:
        """Read a plane; None if it has no direction."""
        normal = values.vector(values.table(value).get("normal"))
        length = float(np.linalg.norm(normal))
        if not 0 < length < np.inf:
            return None
        read = values.record(cls, value, text, normal=normal / length)
        return read if small(read.offset) else None


@dataclass(frozen=True)
class SceneFixture:
    """A static solid (``shape`` in the file), placed in the world."""

    name: str
    solid: Solid

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``fixtures``."""
        return {"name": self.name, "shape": self.solid.to_json()}

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> SceneFixture | None:
        """Read a fixture; None if its shape cannot be read."""
        entry = values.table(value)
        solid = Solid.from_json(entry.get("shape"))
        return None if solid is None else cls(text(entry.get("name")), solid)


@dataclass(frozen=True)
class SceneTerrain:
    """Heights ``z`` (rows, columns) of the ground at ``y`` (rows,), ``x`` (columns,) [m]; nan where there is none."""

    name: str
    x: Array
    y: Array
    z: Array

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``terrain``."""
        return {"name": self.name, "x": self.x.tolist(), "y": self.y.tolist(), "z": self.z.tolist()}

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> SceneTerrain | None:
        """Read terrain; None if its heights are no grid over rising x and y."""
        entry = values.table(value)
        x, y, rows = values.numbers(entry.get("x")), values.numbers(entry.get("y")), entry.get("z")
        found = [values.numbers(row) for row in rows] if isinstance(rows, list) else []
        if len(found) != y.size or any(row.size != x.size for row in found) or min(x.size, y.size) < 2:
            return None
        if not all(small(side) and (np.diff(side) > 0).all() for side in (x, y)):
            return None
        z = np.array(found)
        return cls(text(entry.get("name")), x, y, np.where(np.abs(z) <= MAX_DRAWABLE, z, np.nan))


@dataclass(frozen=True)
class SceneContact:
    """Two surfaces that may touch.

    Attributes:
        name: as contacts of a trajectory are called, without the number of the point.
        body: that the recorded force acts on.
        solid: which of its solids touches; -1 for any.
        other: the other body, or the static surface.
        friction: Coulomb's coefficient, the larger of two; nan where it is not known.
    """

    name: str
    body: str
    solid: int = -1
    other: str = ""
    friction: float = np.nan

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``contacts``."""
        return asdict(self)

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> SceneContact | None:
        """Read a contact; None if it names none."""
        read = values.record(cls, value, text)
        return read if read.name and read.body else None


@dataclass(frozen=True)
class SceneMark:
    """A place that a target asks for, or a plane that a constraint keeps something from.

    Attributes:
        name: of the target or constraint.
        at: (3,) [m], nan along what is free.
        tolerance: [m].
        limit: whether it is a constraint's.
    """

    name: str
    at: Array
    tolerance: float = 0.0
    limit: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``marks``."""
        return {"name": self.name, "at": self.at.tolist(), "tolerance": self.tolerance, "limit": self.limit}

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> SceneMark | None:
        """Read a mark; None if it has no place that can be drawn."""
        read = values.record(cls, value, text, at=values.vector(values.table(value).get("at"), np.nan))
        known = read.at[np.isfinite(read.at)]
        return read if known.size and small([*known, read.tolerance]) else None


@dataclass(frozen=True)
class Scene:
    """The surroundings of a trajectory, and its bodies; ``gravity`` (3) [m/s^2], empty if it is not known."""

    gravity: tuple[float, ...] = ()
    bodies: tuple[SceneBody, ...] = ()
    planes: tuple[ScenePlane, ...] = ()
    fixtures: tuple[SceneFixture, ...] = ()
    terrain: tuple[SceneTerrain, ...] = ()
    joints: tuple[SceneJoint, ...] = ()
    contacts: tuple[SceneContact, ...] = ()
    marks: tuple[SceneMark, ...] = ()

    @property
    def weight_per_mass(self) -> float:
        """Return the size of gravity [m/s^2]; nan if it is not known."""
        return float(np.linalg.norm(self.gravity)) if self.gravity else np.nan

    def solids(self, name: str) -> tuple[Solid, ...]:
        """Return the surface of the body called ``name``; none if the scene has no such body."""
        return next((body.solids for body in self.bodies if body.name == name), ())

    def to_json(self) -> dict[str, Any]:
        """Return the object of scene.json."""
        kinds = {key: getattr(self, key) for key in KINDS}
        return {
            "gravity": list(self.gravity),
            **{key: [each.to_json() for each in found] for key, found in kinds.items()},
        }

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> Scene:
        """Read the scene, as far as it can be read."""
        gravity = tuple(values.numbers(values.table(value).get("gravity")).tolist())
        return values.record(cls, value, text, gravity=gravity)


def read_scene(path: Path) -> Scene:
    """Read the scene in a file. Raises ReportError."""
    return Scene.from_json(read_table(path))
