"""Solids over the step: how far they reach along a direction, and the face and the edge that they turn to another.

A box, a hull, a cylinder and a capsule answer the same questions, in their own axes. The face of a cylinder is the
square on its end whose first corner is the deepest of the rim, or, where it lies, the line of its side; that of a
capsule is the line of its side. A hull's face of more than four corners is the four that cover most of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import casadi as ca
import numpy as np

from symphys.dynamics.collision.body_points import axes
from symphys.dynamics.collision.pairs.cylinder_ground import downhill, without_spin
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.shapes import Box, Capsule, Convex, Cylinder
from symphys.model.shapes.hull import face_table
from symphys.records import dataclass
from symphys.types import Expr

Place = tuple[Expr, Expr]
"""Two numbers in a face [m]."""
MARGIN, ROUND_MARGIN = 0.1, 0.3
"""Depth of the core of a solid, as a share of its smallest half size: of a flat one against another, and of a cylinder.
Beside a round one a flat solid is its own core, so that directions from its edges are exact."""
FLAT_COSINE = 0.7
"""Cosine of the angle between a cylinder's axis and a direction from which on it turns an end to it, not its side."""


@dataclass(frozen=True)
class OwnFace:
    """A face along a solid's own axes.

    Attributes:
        origin, normal, u, v: (3,).
        corners: in order around it, along u and v from the origin [m].
        disc: radius of the disc on whose rim they lie [m]; 0: it is a polygon.
    """

    origin: Expr
    normal: Expr
    u: Expr
    v: Expr
    corners: tuple[Place, ...]
    disc: Expr


class FacedSolid(Protocol):
    """A shape along its own axes. Implementations are frozen dataclasses; d: (3,) a direction of any length."""

    @property
    def size(self) -> Expr:
        """Return its largest extent from its centre, about [m]."""
        ...

    def core(self, d: Expr) -> Expr:
        """Return the point (3,) of its core that is farthest along d: of what lies ``MARGIN`` within it."""
        ...

    def reach(self, d: Expr) -> Expr:
        """Return how far the solid reaches along a unit vector [m]."""
        ...

    def face(self, d: Expr) -> OwnFace:
        """Return the face that it turns to d."""
        ...

    def edges(self, d: Expr) -> list[Expr]:
        """Return directions (3,) of edges that it turns to d."""
        ...


def first_largest(scores: Sequence[Expr], rows: Sequence[Sequence[Any]]) -> tuple[Expr, Expr]:
    """Return the largest score, and its row as a column; the first of equals."""
    best, chosen = scores[0], ca.SX(ca.vertcat(*rows[0]))
    for score, row in zip(scores[1:], rows[1:], strict=True):
        chosen = ca.if_else(score > best, ca.vertcat(*row), chosen)
        best = ca.fmax(best, score)
    return best, chosen


def sign_of(x: Expr) -> Expr:
    """Return 1 for what is not negative, else -1."""
    return ca.if_else(x >= 0, 1, -1)


@dataclass(frozen=True)
class BoxSolid:
    """A box by its half sizes (3,) [m]; ``depth`` of its core, as a share of the smallest."""

    halves: tuple[Expr, ...]
    depth: float

    @property
    def size(self) -> Expr:
        """Implement ``FacedSolid.size``."""
        return ca.SX(sum(self.halves))

    def core(self, d: Expr) -> Expr:
        """Implement ``FacedSolid.core``."""
        halves = ca.vertcat(*map(ca.SX, self.halves))
        return sign_of(d) * (halves - self.depth * ca.mmin(halves))

    def reach(self, d: Expr) -> Expr:
        """Implement ``FacedSolid.reach``."""
        return sum(half * ca.fabs(d[k]) for k, half in enumerate(self.halves))

    def face(self, d: Expr) -> OwnFace:
        """Implement ``FacedSolid.face``."""
        rows = []
        for k in range(3):
            i, j, unit = (k + 1) % 3, (k + 2) % 3, np.eye(3)
            rows.append([*unit[k], *unit[i], *unit[j], self.halves[k], self.halves[i], self.halves[j]])
        _, row = first_largest([ca.fabs(d[k]) for k in range(3)], rows)
        normal = sign_of(ca.dot(row[0:3], d)) * row[0:3]
        x, y = row[10], row[11]
        return OwnFace(row[9] * normal, normal, row[3:6], row[6:9], ((-x, -y), (x, -y), (x, y), (-x, y)), ca.SX(0))

    def edges(self, d: Expr) -> list[Expr]:
        """Implement ``FacedSolid.edges``."""
        return [first_largest([-ca.fabs(d[k]) for k in range(3)], np.eye(3).tolist())[1]]


@dataclass(frozen=True)
class HullSolid:
    """A hull of points; ``depth`` of its core, see ``face_table``."""

    shape: Convex
    depth: float

    @property
    def size(self) -> Expr:
        """Implement ``FacedSolid.size``."""
        return ca.SX(self.shape.extent)

    def core(self, d: Expr) -> Expr:
        """Implement ``FacedSolid.core``."""
        return self._farthest(face_table(self.shape.points, self.depth).core, d)[1]

    def reach(self, d: Expr) -> Expr:
        """Implement ``FacedSolid.reach``."""
        return self._farthest(self.shape.hull.corners, d)[0]

    def face(self, d: Expr) -> OwnFace:
        """Implement ``FacedSolid.face``."""
        table = face_table(self.shape.points, self.depth)
        dots = ca.mtimes(ca.DM(table.normals), d)
        rows = np.hstack([table.origins, table.normals, table.across, table.corners.reshape(len(table.normals), 8)])
        _, row = first_largest([dots[k] for k in range(len(rows))], rows.tolist())
        u, normal = row[6:9], row[3:6]
        places = tuple((row[9 + 2 * k], row[10 + 2 * k]) for k in range(4))
        return OwnFace(row[0:3], normal, u, ca.cross(normal, u), places, ca.SX(0))

    def edges(self, d: Expr) -> list[Expr]:
        """Implement ``FacedSolid.edges``: the one whose lower end is farthest along d."""
        table, heights = face_table(self.shape.points, self.depth), ca.mtimes(ca.DM(self.shape.hull.corners), d)
        scores = [ca.fmin(heights[i], heights[j]) for i, j in table.edges]
        ways = [(self.shape.hull.corners[j] - self.shape.hull.corners[i]).tolist() for i, j in table.edges]
        return [first_largest(scores, ways)[1]]

    def _farthest(self, corners: Any, d: Expr) -> tuple[Expr, Expr]:
        heights = ca.mtimes(ca.DM(corners), d)
        return first_largest([heights[k] for k in range(len(corners))], corners.tolist())


@dataclass(frozen=True)
class CylinderSolid:
    """A cylinder along z, by its radius and half length [m]."""

    radius: Expr
    half_length: Expr

    @property
    def size(self) -> Expr:
        """Implement ``FacedSolid.size``."""
        return ca.SX(self.radius + self.half_length)

    def core(self, d: Expr) -> Expr:
        """Implement ``FacedSolid.core``."""
        inside = ROUND_MARGIN * ca.fmin(self.radius, self.half_length)
        around = (self.radius - inside) * self._around(d)
        return ca.vertcat(around[0], around[1], sign_of(d[2]) * (self.half_length - inside))

    def reach(self, d: Expr) -> Expr:
        """Implement ``FacedSolid.reach``."""
        return self.radius * ca.sqrt(d[0] * d[0] + d[1] * d[1] + TINY_SQUARE) + self.half_length * ca.fabs(d[2])

    def face(self, d: Expr) -> OwnFace:
        """Implement ``FacedSolid.face``."""
        around, r, half = self._around(d), self.radius, self.half_length
        stands = ca.fabs(d[2]) > FLAT_COSINE * ca.sqrt(ca.dot(d, d))
        up, side = sign_of(d[2]) * ca.SX([0, 0, 1]), around
        end = [(r, 0), (0, r), (-r, 0), (0, -r)]
        both = zip(end, self._line, strict=True)
        corners = tuple((ca.if_else(stands, x, s), ca.if_else(stands, y, z)) for (x, y), (s, z) in both)
        normal = ca.if_else(stands, up, side)
        u = ca.if_else(stands, side, ca.SX([0, 0, 1]))
        origin = ca.if_else(stands, half * up, r * side)
        return OwnFace(origin, normal, u, ca.cross(normal, u), corners, ca.if_else(stands, r, 0))

    def edges(self, d: Expr) -> list[Expr]:
        """Implement ``FacedSolid.edges``: its axis, and the tangent of the rim."""
        around = self._around(d)
        return [ca.SX([0, 0, 1]), ca.vertcat(-around[1], around[0], 0)]

    @property
    def _line(self) -> tuple[Place, ...]:
        """Return the corners of the line of its side."""
        half = self.half_length
        return ((-half, 0), (half, 0), (half, 0), (-half, 0))

    def _around(self, d: Expr) -> Expr:
        """Return the unit vector (3,) across the axis that is nearest to d."""
        return downhill(-d, ca.SX([0, 0, 1]), ca.SX([1, 0, 0]))


@dataclass(frozen=True)
class CapsuleSolid(CylinderSolid):
    """A capsule along z, by its radius and half length [m]; its core is its axis."""

    def core(self, d: Expr) -> Expr:
        """Implement ``FacedSolid.core``."""
        return ca.vertcat(0, 0, sign_of(d[2]) * self.half_length)

    def reach(self, d: Expr) -> Expr:
        """Implement ``FacedSolid.reach``."""
        return self.radius + self.half_length * ca.fabs(d[2])

    def face(self, d: Expr) -> OwnFace:
        """Implement ``FacedSolid.face``: along its axis, a radius farther along d."""
        unit, around, axis = d / ca.sqrt(ca.dot(d, d) + TINY_SQUARE), self._around(d), ca.SX([0, 0, 1])
        return OwnFace(self.radius * unit, around, axis, ca.cross(around, axis), self._line, ca.SX(0))

    def edges(self, d: Expr) -> list[Expr]:
        """Implement ``FacedSolid.edges``."""
        return [ca.SX([0, 0, 1])]


def solid_of(shape: Box | Convex | Cylinder | Capsule, depth: float) -> FacedSolid:
    """Return the solid of a shape; ``depth``: of the core of a flat one."""
    if isinstance(shape, Box):
        return BoxSolid(shape.half_sizes, depth)
    if isinstance(shape, Convex):
        return HullSolid(shape, depth)
    kind = CylinderSolid if isinstance(shape, Cylinder) else CapsuleSolid
    return kind(shape.radius, shape.half_length)


@dataclass(frozen=True)
class MovingFace:
    """A face over the step: paths of its origin, of its normal, u and v, and of its corners; see ``OwnFace``."""

    origin: Parabola
    normal: Parabola
    u: Parabola
    v: Parabola
    corners: tuple[Parabola, ...]
    places: tuple[Place, ...]
    disc: Expr

    @property
    def flat(self) -> Expr:
        """Return 1 for a face that has an area, 0 for a line."""
        (p, q), (u, v), (r, s), (w, x) = self.places
        return ca.logic_or(self.disc > 0, (r - p) * (x - v) - (s - q) * (w - u) > 0)

    def point(self, x: Expr, y: Expr) -> Parabola:
        """Return the path of the point at x, y [m] from its origin."""
        path: Parabola = self.origin + x * self.u + y * self.v
        return path

    def place(self, point: Expr, t: Expr) -> Place:
        """Return where a point (3,) is along u and v at time t."""
        away = point - self.origin.at(t)
        return ca.dot(away, self.u.at(t)), ca.dot(away, self.v.at(t))

    def sides(self) -> list[tuple[Place, Place]]:
        """Return the ends of its sides."""
        return [(self.places[k], self.places[(k + 1) % 4]) for k in range(4)]


@dataclass(frozen=True)
class MovingSolid:
    """A solid that a body carries.

    Attributes:
        solid: along its own axes.
        path: of the body.
        centre, axes: paths of its centre and of its axes.
        shape: where it lies in the body.
        round: whether it may turn about its axis without a change.
    """

    solid: FacedSolid
    path: PredictedPath
    centre: Parabola
    axes: tuple[Parabola, Parabola, Parabola]
    shape: Any
    round: bool

    def inside(self, d: Expr, t: Expr) -> Expr:
        """Return a vector (3,) along its own axes at time t."""
        return ca.vertcat(*(ca.dot(axis.at(t), d) for axis in self.axes))

    def outside(self, own: Expr, t: Expr) -> Expr:
        """Return a vector (3,) of its own axes in the world's."""
        total: Expr = sum(own[k] * axis.at(t) for k, axis in enumerate(self.axes))
        return total

    def core(self, d: Expr, t: Expr) -> Expr:
        """Return the point (3,) of its core that is farthest along d."""
        return self.centre.at(t) + self.outside(self.solid.core(self.inside(d, t)), t)

    def reach(self, d: Expr, t: Expr) -> Expr:
        """Return how far it reaches along a unit vector from its centre [m]."""
        return self.solid.reach(self.inside(d, t))

    def edges(self, d: Expr, t: Expr) -> list[Parabola]:
        """Return the paths of the directions of edges that it turns to d at time t."""
        frame = self._frame(d)
        own = self.solid.edges(ca.vertcat(*(ca.dot(axis.at(t), d) for axis in frame)))
        return [sum_of(edge, frame) for edge in own]

    def face(self, d: Expr, t: Expr) -> MovingFace:
        """Return the face that it turns to d at time t; a round one does not turn with its spin (``without_spin``)."""
        frame = self._frame(d)
        own = self.solid.face(ca.vertcat(*(ca.dot(axis.at(t), d) for axis in frame)))
        centre = self.centre
        origin: Parabola = centre + sum_of(own.origin, frame)
        normal, u, v = (sum_of(each, frame) for each in (own.normal, own.u, own.v))
        corners = tuple(origin + x * u + y * v for x, y in own.corners)
        return MovingFace(origin, normal, u, v, corners, own.corners, own.disc)

    def outermost(self, place: Expr, d: Expr, t: Expr) -> Parabola:
        """Return the path of the point at a place (3,) that is as far along a unit vector as it reaches at time t."""
        away, frame = place - self.centre.at(t), self._frame(d)
        away = away + d * (self.reach(d, t) - ca.dot(d, away))
        path: Parabola = self.centre + sum_of(ca.vertcat(*(ca.dot(axis.at(t), away) for axis in frame)), frame)
        return path

    def _frame(self, d: Expr) -> tuple[Parabola, Parabola, Parabola]:
        if not self.round:
            return self.axes
        return axes(without_spin(self.path, self.axes[2].start, d), self.shape)


def sum_of(own: Expr, frame: tuple[Parabola, Parabola, Parabola]) -> Parabola:
    """Return the path of a vector by its numbers along carried axes."""
    total: Parabola = own[0] * frame[0] + own[1] * frame[1] + own[2] * frame[2]
    return total


def moving_solids(
    shapes: tuple[Any, Any], paths: tuple[PredictedPath, PredictedPath]
) -> tuple[MovingSolid, MovingSolid]:
    """Return two solids that are carried along paths."""
    rounds = [isinstance(shape, Cylinder | Capsule) for shape in shapes]
    depth = 0.0 if any(rounds) else MARGIN
    first, second = (
        MovingSolid(solid_of(shape, depth), path, path.path(shape.centre), axes(path, shape), shape, turns)
        for shape, path, turns in zip(shapes, paths, rounds, strict=True)
    )
    return first, second
