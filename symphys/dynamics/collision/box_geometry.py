"""Boxes over the step: their axes, the face that each turns to the other, and the direction that keeps them apart."""

from __future__ import annotations

from typing import Any

import casadi as ca

from symphys.dynamics.collision.body_points import axes
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath, chosen
from symphys.dynamics.collision.witness_points import steady
from symphys.model.scalar import is_zero
from symphys.model.shapes import Box, Capsule
from symphys.records import dataclass
from symphys.types import Expr

PARALLEL = 1e-6
"""Square of the sine of the angle below which edges count as parallel."""
EDGE_MARGIN = 1e-6
"""Share of the boxes' size by which edges must be farther apart than faces for a contact of edges."""
TINY_CHANGE = 1e-15
"""[m] a distance that changes less than this over the step does not change."""
MAX_STEP_UP = 0.0015
"""[m] the highest step onto which a box slides: less of an overlap with a top does not count as one with its side."""
MAX_STEP_UP_SHARE = 0.1
"""That step is at most this share of the shortest edge of both boxes."""
MIN_OVERLAP = 1e-6
"""[m] Smallest overlap that counts in directions that are not upright; less is within the tolerance of a contact."""
MIN_VERTICAL_COSINE = 0.7
"""Cosine of the angle from the vertical within which a direction of separation belongs to a top."""


@dataclass(frozen=True)
class MovingBox:
    """A box over the step.

    Attributes:
        centre, axes: paths of its centre and its three axes.
        halves: (3,) half sizes [m].
        velocity: (3,) true velocity of its centre at the start [m/s].
        gravity: (3,) [m/s^2]; None: there is no up and down.
    """

    centre: Parabola
    axes: tuple[Parabola, Parabola, Parabola]
    halves: tuple[Expr, ...]
    velocity: Expr
    gravity: Expr | None

    def reach(self, direction: Expr, t: Expr) -> Expr:
        """Return the support along a vector: the extent from the centre times the vector's length."""
        total: Expr = sum(
            h * ca.fabs(ca.dot(axis.at(t), direction)) for h, axis in zip(self.halves, self.axes, strict=True)
        )
        return total


@dataclass(frozen=True)
class Face:
    """A face over the step: paths of its centre, its outward normal and its two axes, half sizes along these."""

    centre: Parabola
    normal: Parabola
    u: Parabola
    v: Parabola
    half_u: Expr
    half_v: Expr

    def point(self, x: Expr, y: Expr) -> Parabola:
        """Return the path of the point at x, y [m] from its centre."""
        body_path: Parabola = self.centre + x * self.u + y * self.v
        return body_path

    def corners(self) -> list[Parabola]:
        """Return the paths of its corners, in order around it."""
        signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        return [self.point(su * self.half_u, sv * self.half_v) for su, sv in signs]


def moving_box(shape: Box | Capsule, body_path: PredictedPath) -> MovingBox:
    """Return a box, or the axis of a capsule as one without width, that is carried along a path."""
    halves = shape.half_sizes if isinstance(shape, Box) else (0.0, 0.0, shape.half_length)
    velocity = body_path.true_velocity_of(shape.centre)
    return MovingBox(body_path.path(shape.centre), axes(body_path, shape), halves, velocity, body_path.gravity)


def nearest_face(box: MovingBox, direction: Expr, t: Expr) -> Face:
    """Return the face whose outward normal is nearest to ``direction`` at time t."""
    along = [ca.dot(axis.at(t), direction) for axis in box.axes]
    first = ca.logic_and(ca.fabs(along[0]) >= ca.fabs(along[1]), ca.fabs(along[0]) >= ca.fabs(along[2]))
    second = ca.logic_and(ca.logic_not(first), ca.fabs(along[1]) >= ca.fabs(along[2]))
    which = (first, second, ca.logic_not(ca.logic_or(first, second)))

    def pick(values: list[Any]) -> Any:
        total = which[0] * values[0]
        for share, value in zip(which[1:], values[1:], strict=True):
            total = total + share * value
        return total

    turned = [[values[(i + k) % 3] for i in range(3)] for k in range(3) for values in (box.axes, box.halves)]
    normal = ca.if_else(pick(along) >= 0, 1, -1) * pick(turned[0])
    return Face(
        box.centre + pick(turned[1]) * normal,
        normal,
        pick(turned[2]),
        pick(turned[4]),
        pick(turned[3]),
        pick(turned[5]),
    )


def faces_and_edges(a: MovingBox, b: MovingBox) -> tuple[list[Parabola], list[Parabola]]:
    """Return the directions along which two boxes can be apart: face normals of both, and edge across edge."""
    return [*a.axes, *b.axes], [one.cross(other) for one in a.axes for other in b.axes]


@dataclass(frozen=True)
class BoxOverlap:
    """The overlap of two boxes along the direction in which it begins last.

    Attributes:
        direction: its path, from the second to the first.
        time: when they begin to overlap along all directions; 0 if they do from the start, the end of the step if
            never.
        distance: along it, at the start [m].
        apart: 1 if they never overlap along all directions at once.
    """

    direction: Parabola
    time: Expr
    distance: Expr
    apart: Expr


def first_overlap(
    a: MovingBox, b: MovingBox, faces: list[Parabola], edges: list[Parabola], dt: Expr, radius: Expr = 0.0
) -> BoxOverlap:
    """Find when and along which direction two boxes come to overlap, the first of them grown by ``radius``.

    The direction is the one along which they overlap last, the first of equals. It is found on the straight paths along
    the true velocities, without weight, since the support of a box cancels its weight. An overlap that is smaller than
    a tolerance does not count. So a box that slides on a top meets no
    side of a block whose top is as high, lower, or higher by up to ``MAX_STEP_UP``: there it comes onto the top.
    """
    directions, still = [*faces, *edges], (a.centre - b.centre).start
    starts = overlap_places(a, b, faces, edges, ca.SX(0), still, radius)
    ends = overlap_places(a, b, faces, edges, dt, (a.centre - b.centre).at(dt), radius)
    ways = overlap_places(a, b, faces, edges, dt, still + dt * (a.velocity - b.velocity), radius)
    allowed = tolerances(a, b, directions)
    best, last, largest, first_exit, met = directions[0], ca.SX(-1), ca.SX(0), ca.SX(1), ca.SX(0)
    for direction, tolerance, (before, reach), (after, reach_after), (led, _) in zip(
        directions, allowed, starts, ends, ways, strict=True
    ):
        side = ca.if_else(before >= 0, 1, -1)
        start, end = side * before - reach, side * after - reach_after
        met = ca.fmax(met, overlaps_from(start, end))
        leaves = ca.if_else(start > 0, 1, crossed(start, end))
        passes = crossed(-side * before - reach, -side * after - reach_after)
        first_exit = ca.fmin(first_exit, ca.fmin(leaves, passes))
        enters = overlaps_from(start + tolerance, side * led - reach_after + tolerance)
        later = ca.logic_or(enters > last, ca.logic_and(enters == last, start > largest))
        best, last = chosen(later, side * direction, best), ca.if_else(later, enters, last)
        largest = ca.if_else(later, start, largest)
    apart = ca.logic_or(met > first_exit, met >= 1)
    return BoxOverlap(steady(best, met * dt, dt), met * dt, largest, apart)


def tolerances(a: MovingBox, b: MovingBox, directions: list[Parabola]) -> list[Expr]:
    """Return for each direction the overlap [m] that is tolerated along it."""
    gravity = a.gravity if a.gravity is not None else b.gravity
    if gravity is None:
        return [ca.SX(MIN_OVERLAP)] * len(directions)
    step = ca.fmin(MAX_STEP_UP, MAX_STEP_UP_SHARE * 2 * shortest([*a.halves, *b.halves]))
    return [ca.if_else(is_nearly_vertical(direction.start, gravity), step, MIN_OVERLAP) for direction in directions]


def is_nearly_vertical(direction: Expr, gravity: Expr) -> Expr:
    """Return 1 if a direction (3,) is near the vertical, which there is only with gravity."""
    lean = ca.dot(direction, gravity)
    return lean * lean > MIN_VERTICAL_COSINE * MIN_VERTICAL_COSINE * ca.dot(direction, direction) * ca.dot(
        gravity, gravity
    )


def shortest(halves: list[Expr]) -> Expr:
    """Return the smallest half size that is not 0, as those of a line are."""
    wide = [ca.SX(half) for half in halves if not is_zero(half)]
    return ca.mmin(ca.vertcat(*wide))


def overlaps_from(start: Expr, end: Expr) -> Expr:
    """Return the share of the step after which a linear distance is negative; 0 if it is negative at once."""
    return ca.if_else(start > 0, crossed(start, end), 0)


def crossed(start: Expr, end: Expr) -> Expr:
    """Return the share of the step after which a linear distance is 0; 1 if it never is."""
    crosses = ca.logic_and(start * end <= 0, ca.fabs(start - end) > TINY_CHANGE)
    return ca.if_else(crosses, start / ca.if_else(crosses, start - end, 1), 1)


def overlap_places(
    a: MovingBox,
    b: MovingBox,
    faces: list[Parabola],
    edges: list[Parabola],
    t: Expr,
    apart: Expr,
    radius: Expr,
) -> list[tuple[Expr, Expr]]:
    """Return for each direction the distance of the centres at time t, and that below which boxes overlap [m].

    ``apart``: (3,) from the second centre to the first then [m].
    """
    found = []
    size = sum(a.halves) + sum(b.halves)
    for k, direction in enumerate([*faces, *edges]):
        along = direction.at(t)
        square = ca.dot(along, along)
        place, reach = ca.dot(apart, along), a.reach(along, t) + b.reach(along, t)
        if k < len(faces):
            found.append((place / ca.sqrt(square), reach / ca.sqrt(square) + radius))
            continue
        parallel, scale = square < PARALLEL, ca.sqrt(ca.fmax(square, PARALLEL))
        across = ca.if_else(parallel, 2 * size, reach / scale + EDGE_MARGIN * size)
        found.append((ca.if_else(parallel, 0, place / scale), across + radius))
    return found
