"""Boxes over the step: their axes, the face that each turns to the other, and the direction that keeps them apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.collide.placing import axes
from symphys.course import Course, Parabola
from symphys.shapes import Box

Expr = Any
"""casadi SX"""

PARALLEL = 1e-6
"""Square of the sine of the angle below which edges count as parallel."""
FACES_FIRST = 1e-6
"""Of the boxes' size: how much farther apart than faces edges must be for a contact of edges."""


@dataclass(frozen=True)
class Block:
    """A box over the step: courses of its centre and its three axes, half sizes (3,) [m]."""

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
    """A face over the step: courses of its centre, its outward normal and its two axes, half sizes along these."""

    centre: Parabola
    normal: Parabola
    u: Parabola
    v: Parabola
    half_u: Expr
    half_v: Expr

    def point(self, x: Expr, y: Expr) -> Parabola:
        """The course of the point at x, y [m] from its centre."""
        course: Parabola = self.centre + x * self.u + y * self.v
        return course

    def corners(self) -> list[Parabola]:
        """The courses of its corners, in order around it."""
        signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        return [self.point(su * self.half_u, sv * self.half_v) for su, sv in signs]


def block(box: Box, course: Course) -> Block:
    """A box that is carried along a course."""
    return Block(course.path(box.centre), axes(course, box), box.half_sizes)


def facing(box: Block, direction: Expr, t: Expr) -> Face:
    """The face whose outward normal is nearest to ``direction`` at time t."""
    along = [ca.dot(axis.at(t), direction) for axis in box.axes]
    first = ca.logic_and(ca.fabs(along[0]) >= ca.fabs(along[1]), ca.fabs(along[0]) >= ca.fabs(along[2]))
    second = ca.logic_and(ca.logic_not(first), ca.fabs(along[1]) >= ca.fabs(along[2]))
    chosen = (first, second, ca.logic_not(ca.logic_or(first, second)))

    def pick(values: list[Any]) -> Any:
        total = chosen[0] * values[0]
        for share, value in zip(chosen[1:], values[1:], strict=True):
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


def candidates(a: Block, b: Block) -> list[Parabola]:
    """The directions along which two boxes can be apart: face normals of both, then edge across edge."""
    return [*a.axes, *b.axes, *(one.cross(other) for one in a.axes for other in b.axes)]


def separations(a: Block, b: Block, directions: list[Parabola], t: Expr, since: Expr | None = None) -> list[Expr]:
    """How far apart two boxes are along each of the directions at time t [m]; negative where they overlap.

    With ``since``, an earlier time, boxes that have passed each other from then to t count as overlapping.
    """
    centres, found = a.centre - b.centre, []
    size = sum(a.halves) + sum(b.halves)
    for k, direction in enumerate(directions):
        along = direction.at(t)
        square = ca.dot(along, along)
        apart = ca.dot(centres.at(t), along)
        before = apart if since is None else ca.dot(centres.at(since), direction.at(since))
        distance = ca.if_else(before >= 0, apart, -apart) - a.reach(along, t) - b.reach(along, t)
        if k < len(a.axes) + len(b.axes):
            found.append(distance / ca.sqrt(square))
            continue
        edges = distance / ca.sqrt(ca.fmax(square, PARALLEL)) - FACES_FIRST * size
        found.append(ca.if_else(square < PARALLEL, -2 * size, edges))
    return found


def meeting_time(before: list[Expr], after: list[Expr], dt: Expr) -> Expr:
    """When two boxes stop being apart along every direction, from their distances at the start and the end."""
    time: Expr = ca.SX(0)
    for start, end in zip(before, after, strict=True):
        share = ca.if_else(end < 0, start / ca.fmax(start - end, 1e-12), 1)
        time = ca.fmax(time, ca.if_else(start > 0, dt * ca.fmin(share, 1), 0))
    return time


def farthest(directions: list[Parabola], distances: list[Expr]) -> tuple[Parabola, Expr]:
    """The direction along which two boxes are farthest apart, and that distance; the first of equals."""
    best, largest = directions[0], distances[0]
    for direction, distance in zip(directions[1:], distances[1:], strict=True):
        better = distance > largest
        best = Parabola(
            ca.if_else(better, direction.start, best.start),
            ca.if_else(better, direction.velocity, best.velocity),
            ca.if_else(better, direction.acceleration, best.acceleration),
        )
        largest = ca.fmax(distance, largest)
    return best, largest
