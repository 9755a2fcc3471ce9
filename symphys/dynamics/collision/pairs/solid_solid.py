"""Hulls, cylinders, boxes and capsules on one body against others on another, or static ones: four points.

Each turns one face to the other. The candidates are the corners of these two faces over the other face, and where
sides of the one enter and leave the other; of two cylinders also where their axes cross. Four of them carry what they
carry, as of two boxes (``box_box``). Where there is none, as of a rim on an edge, the nearest points count.

What it cannot do: two pairs of faces that meet in the same step; solids that have sunk into each other deeper than
about a tenth of the thinner one may be pushed out at another side; rims on rims and edges, beyond about a millimetre.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.pairs.box_box import (
    FAR,
    MIN_EDGE_CHANGE,
    RIM_SHARE,
    BoxApproach,
    FacePoint,
    spread_out,
)
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.separation import SeparatingDirection, separation_of
from symphys.dynamics.collision.solids import MovingFace, MovingSolid, Place, moving_solids
from symphys.dynamics.tracing.decorator import traced
from symphys.types import Expr

DEEPER_SHARE = 1e-5
"""Share of the solids' size by which the nearest points must be deeper than others to count beside them."""
Clip = tuple[Expr, Expr]
"""Shares of a way at which it enters and leaves."""


def solid_solid(first: Any, second: Any, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return four points of the region that both faces cover."""
    one, other = _solids(first, second, a, b)
    near = separation_of(one, other, a.dt)
    approach, points = _shared_region(one, other, near)
    return [_contact(approach, point) for point in points]


@traced
def _solids(first: Any, second: Any, a: PredictedPath, b: PredictedPath) -> tuple[MovingSolid, MovingSolid]:
    return moving_solids((first, second), (a, b))


@traced
def _shared_region(
    one: MovingSolid, other: MovingSolid, near: SeparatingDirection
) -> tuple[BoxApproach, tuple[FacePoint, ...]]:
    size, (a, b) = one.solid.size + other.solid.size, (one.path, other.path)
    approach = BoxApproach((a, b), near.direction, near.time, near.apart, ca.fmax(near.distance, 0) + size)
    now = approach.normal.at(near.time)
    unit = now / ca.norm_2(now)
    face, ground = one.face(-unit, near.time), other.face(unit, near.time)
    flipped = approach.flipped()
    candidates = [
        *corners_over(face, ground, approach),
        *(each.flipped() for each in corners_over(ground, face, flipped)),
        *crossings(face, ground, approach),
    ]
    if other.round:  # a line has no inside that others could enter
        candidates += [each.flipped() for each in crossings(ground, face, flipped)]
        candidates.append(lines_crossing(face, ground, approach))
    candidates.append(nearest_points(near, candidates, size))
    return approach, tuple(spread_out(candidates, ground, near.time, size))


@traced
def _contact(approach: BoxApproach, point: FacePoint) -> Contact:
    return approach.contact(point.points, point.normal, point.on, share=point.share)


def nearest_points(near: SeparatingDirection, candidates: list[FacePoint], size: Expr) -> FacePoint:
    """Return the nearest points, where no other candidate is, or where they are deeper.

    They count along the direction that keeps the solids farthest apart alone: along that of a top, which is preferred,
    the nearest points of what overhangs it lie beyond its rim.
    """
    t, normal = near.time, near.direction.at(near.time)
    unit = normal / ca.norm_2(normal)
    covered, least = ca.SX(0), ca.SX(FAR * size)
    for each in candidates:
        covered = ca.logic_or(covered, each.on)
        least = ca.fmin(least, ca.if_else(each.on, ca.dot(unit, (each.points[0] - each.points[1]).at(t)), FAR * size))
    one, other = near.nearest
    deeper = ca.dot(unit, (one - other).at(t)) < least - DEEPER_SHARE * size
    on = ca.logic_and(near.farthest, ca.logic_or(ca.logic_not(covered), deeper))
    return FacePoint(near.nearest, near.direction, on)


def corners_over(face: MovingFace, ground: MovingFace, approach: BoxApproach) -> list[FacePoint]:
    """Return the corners of a face over the other."""
    found, t = [], approach.time
    for corner in face.corners:
        x, y = ground.place(corner.at(t), t)
        found.append(FacePoint((corner, ground.point(x, y)), ground.normal, within(ground, (x, y)), 1.0))
    return found


def within(face: MovingFace, place: Place) -> Expr:
    """Return 1 where a place lies in a face, or by a thousandth beyond its rim."""
    inside = ca.SX(1)
    for start, end in face.sides():
        depth, length = beside(place, start, end)
        inside = ca.logic_and(inside, depth >= -RIM_SHARE * length * length)
    polygon = ca.logic_and(inside, face.flat)  # a line encloses nothing
    x0, y0 = place
    round_ = x0 * x0 + y0 * y0 <= ((1 + RIM_SHARE) * face.disc) ** 2
    return ca.if_else(face.disc > 0, round_, polygon)


def beside(place: Place, start: Place, end: Place) -> tuple[Expr, Expr]:
    """Return how far a place is to the left of a side, times its length, and that length [m]."""
    along, across = end[0] - start[0], end[1] - start[1]
    depth = along * (place[1] - start[1]) - across * (place[0] - start[0])
    return depth, ca.sqrt(along * along + across * across + MIN_EDGE_CHANGE**2)


def crossings(face: MovingFace, ground: MovingFace, approach: BoxApproach) -> list[FacePoint]:
    """Return where sides of a face enter and leave the region over the other."""
    t, n = approach.time, approach.normal.at(approach.time)
    upright, base = ground.normal.at(t), ground.origin.at(t)
    steep = ca.dot(upright, n)
    safe = ca.if_else(ca.fabs(steep) > RIM_SHARE, steep, 1)
    flat = []
    for corner in face.corners:
        away = corner.at(t) - base
        flat.append(ground.place(base + away - n * (ca.dot(upright, away) / safe), t))
    found = []
    for k in range(4):
        start, end = k, (k + 1) % 4
        enters, leaves = clipped(ground, flat[start], flat[end])
        (x0, y0), (x1, y1) = flat[start], flat[end]
        for share in (enters, leaves):
            on = ca.logic_and(ca.logic_and(share > 0, share < 1), enters < leaves)
            at = ca.fmin(ca.fmax(share, 0), 1)
            point = (1 - at) * face.corners[start] + at * face.corners[end]
            foot = ground.point(x0 + at * (x1 - x0), y0 + at * (y1 - y0))
            found.append(FacePoint((point, foot), approach.normal, on))
    return found


def clipped(ground: MovingFace, start: Place, end: Place) -> Clip:
    """Return the shares of a way at which it enters and leaves a face; 1 and 0 where it passes by."""
    enters, leaves = ca.SX(-1), ca.SX(2)
    for p, q in ground.sides():
        (first, length), (last, _) = beside(start, p, q), beside(end, p, q)
        change = last - first
        along = ca.fabs(change) < MIN_EDGE_CHANGE * length
        share = -first / ca.if_else(along, 1, change)
        outside = ca.logic_and(along, first < -RIM_SHARE * length * length)
        enters = ca.fmax(enters, ca.if_else(along, ca.if_else(outside, 3, -1), ca.if_else(change > 0, share, -1)))
        leaves = ca.fmin(leaves, ca.if_else(along, 2, ca.if_else(change < 0, share, 2)))
    x, y, u, v = start[0], start[1], end[0] - start[0], end[1] - start[1]
    square, half, rest = u * u + v * v, x * u + y * v, x * x + y * y - ground.disc * ground.disc
    root = half * half - square * rest
    meets = ca.logic_and(root > 0, square > MIN_EDGE_CHANGE**2)
    way, safe = ca.sqrt(ca.if_else(meets, root, 1)), ca.if_else(meets, square, 1)
    disc = ground.disc > 0
    return (
        ca.if_else(disc, ca.if_else(meets, (-half - way) / safe, 3), enters),
        ca.if_else(disc, ca.if_else(meets, (-half + way) / safe, -1), leaves),
    )


def lines_crossing(face: MovingFace, ground: MovingFace, approach: BoxApproach) -> FacePoint:
    """Return where the first sides of both cross, seen along the approach."""
    t, n = approach.time, approach.normal.at(approach.time)
    (p, q), (r, s) = ([each.corners[k].at(t) for k in (0, 1)] for each in (face, ground))
    along, other, apart = q - p, s - r, r - p
    spread = ca.dot(n, ca.cross(along, other))
    crosses = ca.fabs(spread) > RIM_SHARE * ca.norm_2(n) * ca.sqrt(ca.dot(along, along) * ca.dot(other, other))
    safe = ca.if_else(crosses, spread, 1)
    share, also = ca.dot(n, ca.cross(apart, other)) / safe, ca.dot(n, ca.cross(apart, along)) / safe
    inside = [ca.logic_and(each > 0, each < 1) for each in (share, also)]
    on = ca.logic_and(crosses, ca.logic_and(*inside))
    one, two = (ca.fmin(ca.fmax(each, 0), 1) for each in (share, also))
    point = (1 - one) * face.corners[0] + one * face.corners[1]
    foot = (1 - two) * ground.corners[0] + two * ground.corners[1]
    return FacePoint((point, foot), approach.normal, on)
