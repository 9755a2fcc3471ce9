"""Boxes over the step: their axes, the face that each turns to the other, and the direction that keeps them apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.collision.body_points import axes
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath, chosen
from symphys.dynamics.collision.witness_points import steady
from symphys.model.shapes import Box

Expr = Any
"""casadi SX"""

PARALLEL = 1e-6
"""Square of the sine of the angle below which edges count as parallel."""
FACES_FIRST = 1e-6
"""Of the boxes' size: how much farther apart than faces edges must be for a contact of edges."""
TINY_CHANGE = 1e-15
"""[m] a distance that changes less than this over the step does not change."""


@dataclass(frozen=True)
class MovingBox:
    """A box over the step: paths of its centre and its three axes, half sizes (3,) [m]."""

    centre: Parabola
    axes: tuple[Parabola, Parabola, Parabola]
    halves: tuple[Expr, ...]

    def reach(self, direction: Expr, t: Expr) -> Expr:
        """How far it extends from its centre along a vector, times the vector's length."""
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
        """The path of the point at x, y [m] from its centre."""
        body_path: Parabola = self.centre + x * self.u + y * self.v
        return body_path

    def corners(self) -> list[Parabola]:
        """The paths of its corners, in order around it."""
        signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        return [self.point(su * self.half_u, sv * self.half_v) for su, sv in signs]


def moving_box(box: Box, body_path: PredictedPath) -> MovingBox:
    """A box that is carried along a path."""
    return MovingBox(body_path.path(box.centre), axes(body_path, box), box.half_sizes)


def facing(box: MovingBox, direction: Expr, t: Expr) -> Face:
    """The face whose outward normal is nearest to ``direction`` at time t."""
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
    """The directions along which two boxes can be apart: face normals of both, and edge across edge."""
    return [*a.axes, *b.axes], [one.cross(other) for one in a.axes for other in b.axes]


@dataclass(frozen=True)
class Nearing:
    """How two boxes come to overlap, along the direction along which they do so last.

    Attributes:
        direction: its path, from the second to the first.
        time: when they begin to overlap along it; 0 if they overlap from the start, the end of the step if never.
        distance: along it, at the start [m].
        apart: 1 if they never overlap along all directions at once.
    """

    direction: Parabola
    time: Expr
    distance: Expr
    apart: Expr


def nearing(
    a: MovingBox, b: MovingBox, faces: list[Parabola], edges: list[Parabola], dt: Expr, radius: Expr = 0.0
) -> Nearing:
    """How two boxes, the first of them grown by ``radius``, come to overlap; the first of equal directions."""
    ends = [places(a, b, faces, edges, t, radius) for t in (ca.SX(0), dt)]
    best, last, largest, first_exit = faces[0], ca.SX(-1), ca.SX(0), ca.SX(1)
    for direction, (before, reach), (after, reach_after) in zip([*faces, *edges], *ends, strict=True):
        side = ca.if_else(before >= 0, 1, -1)
        start, end = side * before - reach, side * after - reach_after
        enters = ca.if_else(start > 0, crossed(start, end), 0)
        leaves = ca.if_else(start > 0, 1, crossed(start, end))
        passes = crossed(-side * before - reach, -side * after - reach_after)
        first_exit = ca.fmin(first_exit, ca.fmin(leaves, passes))
        later = ca.logic_or(enters > last, ca.logic_and(enters == last, start > largest))
        best, last = chosen(later, side * direction, best), ca.if_else(later, enters, last)
        largest = ca.if_else(later, start, largest)
    apart = ca.logic_or(last > first_exit, last >= 1)
    return Nearing(steady(best, last * dt, dt), last * dt, largest, apart)


def crossed(start: Expr, end: Expr) -> Expr:
    """The share of the step after which a distance that changes evenly is 0; 1 if it never is."""
    crosses = ca.logic_and(start * end <= 0, ca.fabs(start - end) > TINY_CHANGE)
    return ca.if_else(crosses, start / ca.if_else(crosses, start - end, 1), 1)


def places(
    a: MovingBox, b: MovingBox, faces: list[Parabola], edges: list[Parabola], t: Expr, radius: Expr
) -> list[tuple[Expr, Expr]]:
    """Along each direction at time t: how far the first box is from the second, and how near is overlapping [m]."""
    apart, found = (a.centre - b.centre).at(t), []
    size = sum(a.halves) + sum(b.halves)
    for k, direction in enumerate([*faces, *edges]):
        along = direction.at(t)
        square = ca.dot(along, along)
        place, reach = ca.dot(apart, along), a.reach(along, t) + b.reach(along, t)
        if k < len(faces):
            found.append((place / ca.sqrt(square), reach / ca.sqrt(square) + radius))
            continue
        parallel, scale = square < PARALLEL, ca.sqrt(ca.fmax(square, PARALLEL))
        across = ca.if_else(parallel, 2 * size, reach / scale + FACES_FIRST * size)
        found.append((ca.if_else(parallel, 0, place / scale), across + radius))
    return found
