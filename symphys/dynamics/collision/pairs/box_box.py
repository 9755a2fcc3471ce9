"""A box on one body against a box on another, or a static one.

Each box turns one face to the other: the one whose normal is nearest to the direction along which they are farthest
apart when they meet. The candidates are the corners of these two faces over the other face, and the points where
edges of the one cross edges of the other: the corners of the region that both faces cover. They are chosen where the
boxes are expected to meet, or at the end of the step. A box that slides over the seam of two boards meets their tops
alone (``box_geometry.first_overlap``).

The region has eight corners at most, and four where faces along each other lie on each other. Four points carry what
they carry: the deepest, the one farthest from it, the one farthest from the line through both, and the one farthest
outside these three. If the region has more corners a box may lean over one that is left out by what its height makes.

What it cannot do: two pairs of faces that meet in the same step; boxes that have sunk into each other deeper than
about half of the thinner one may be pushed out at another side. Where edges cross, the point of contact stays where it
was on both bodies for the rest of the step.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin
from typing import Protocol

import casadi as ca

from symphys.dynamics.collision.box_geometry import (
    BoxOverlap,
    Face,
    faces_and_edges,
    first_overlap,
    moving_box,
    nearest_face,
)
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.dynamics.collision.witness_points import HALF, Witness, contact_of
from symphys.dynamics.tracing.decorator import traced
from symphys.model.shapes import Box
from symphys.records import dataclass
from symphys.types import Expr

RIM_SHARE = 0.001
"""Share of a face's size by which a corner may lie beyond its rim and count as a point of the rim. So no candidate
appears or disappears as boxes that lie flush creep by rounding; it is given up only where others have long been at the
same place."""
MIN_SPREAD = 1e-4
"""Share of the boxes' size by which points lie apart, and off the line of two others, to count beside them."""
TILT = 0.01
"""[rad] how much deeper by distance a point has to be to come first."""
OUTERMOST = cos(0.9), sin(0.9)
"""Direction along a face in which the first of equally deep points lies; along none that faces often have."""
FAVOUR = 0.999
"""Factor on distances at one side of a line, so that of two that are equal rounding does not choose."""
FAR = 1e3
"""Times the boxes' size: more than any distance."""
MIN_EDGE_CHANGE = 1e-9
"""[m] an edge that changes less than this across a strip counts as parallel to it."""


@dataclass(frozen=True)
class BoxApproach:
    """The approach of two boxes: its normal, its time and the overlap.

    Attributes:
        bodies: paths of the bodies that carry them.
        normal: path of the direction that keeps them apart, from the second to the first.
        time: when they are expected to meet [s].
        apart: 1 if they stay apart over the step.
        far: the gap that points have which are no candidates [m].
    """

    bodies: tuple[PredictedPath, PredictedPath]
    normal: Parabola
    time: Expr
    apart: Expr
    far: Expr

    def contact(
        self,
        points: tuple[Parabola, Parabola],
        normal: Parabola,
        on: Expr,
        radius: Expr = 0.0,
        share: Expr | float = HALF,
    ) -> Contact:
        """Return the contact of two points; ``share``: where it lies between them, see ``Witness``."""
        arms = points[0] - self.bodies[0].centre(), points[1] - self.bodies[1].centre()
        off, dt = ca.logic_not(on), self.bodies[0].dt
        met = contact_of(Witness(points, arms, normal, (radius, 0.0), off, self.far, dt, share))
        return replace(met, hit=ca.logic_and(met.hit, ca.logic_not(self.apart)))

    def flipped(self) -> BoxApproach:
        """Return the approach as seen from the other box."""
        return replace(self, bodies=(self.bodies[1], self.bodies[0]), normal=-1 * self.normal)


def approach_of(near: BoxOverlap, bodies: tuple[PredictedPath, PredictedPath], size: Expr) -> BoxApproach:
    """Make the geometry of two boxes."""
    return BoxApproach(bodies, near.direction, near.time, near.apart, ca.fmax(near.distance, 0) + size)


@dataclass(frozen=True)
class FacePoint:
    """A corner of the region that two faces cover.

    Attributes:
        points: paths of the points on both boxes.
        normal: path of the direction across it, from the second box to the first.
        on: 1 if there is such a corner.
        share: where contact is between the points; see ``Witness``.
    """

    points: tuple[Parabola, Parabola]
    normal: Parabola
    on: Expr
    share: Expr | float = HALF

    def flipped(self) -> FacePoint:
        """Return the corner as seen from the other box."""
        share = HALF if self.share is HALF else 1 - self.share
        return FacePoint((self.points[1], self.points[0]), -1 * self.normal, self.on, share)


def box_box(first: Box, second: Box, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return four points of the region that both faces cover."""
    approach, points = _shared_region(first, second, a, b)
    return [_contact(approach, point) for point in points]


@traced
def _shared_region(
    first: Box, second: Box, a: PredictedPath, b: PredictedPath
) -> tuple[BoxApproach, tuple[FacePoint, ...]]:
    one, other = moving_box(first, a), moving_box(second, b)
    near = first_overlap(one, other, *faces_and_edges(one, other), a.dt)
    size = sum(first.half_sizes) + sum(second.half_sizes)
    approach = approach_of(near, (a, b), size)
    normal, time = approach.normal.at(near.time), near.time
    face, ground = nearest_face(one, -normal, time), nearest_face(other, normal, time)
    candidates = [
        *corners_over(face, ground, approach),
        *(each.flipped() for each in corners_over(ground, face, approach.flipped())),
        *crossings(face.corners(), ground, approach),
    ]
    return approach, tuple(spread_out(candidates, ground, time, size))


@traced
def _contact(approach: BoxApproach, point: FacePoint) -> Contact:
    return approach.contact(point.points, point.normal, point.on)


class Flat(Protocol):
    """A face, of which two directions in it are known."""

    @property
    def u(self) -> Parabola:
        """Return the path of one."""
        ...

    @property
    def v(self) -> Parabola:
        """Return the path of the other."""
        ...


def spread_out(candidates: list[FacePoint], ground: Flat, t: Expr, size: Expr) -> list[FacePoint]:
    """Return four of the candidates that carry what all carry; see the module.

    Args:
        candidates: of both faces.
        ground: the second of these.
        t: when they are looked at [s].
        size: of the boxes [m].
    """
    least, u, v = MIN_SPREAD * size, ground.u.at(t), ground.v.at(t)
    places = [(ca.dot(u, each.points[1].at(t)), ca.dot(v, each.points[1].at(t))) for each in candidates]
    heights = [ca.dot(each.normal.at(t), (each.points[0] - each.points[1]).at(t)) for each in candidates]

    def choose(scores: list[Expr], above: Expr) -> tuple[FacePoint, Expr, Expr]:
        """Return the candidate of the highest score, if that is above a bound, and its place."""
        best, free, shares = ca.SX(-FAR * size), ca.SX(1), []
        for score, each in zip(scores, candidates, strict=True):
            best = ca.fmax(best, ca.if_else(each.on, score, -FAR * size))
        for score, each in zip(scores, candidates, strict=True):
            shares.append(ca.logic_and(ca.logic_and(free, each.on), score >= best))
            free = ca.logic_and(free, ca.logic_not(shares[-1]))
        on = ca.logic_and(ca.logic_not(free), best > above)
        paths = [(*each.points, each.normal) for each in candidates]
        first, second, normal = (summed(shares, each) for each in zip(*paths, strict=True))
        x, y = (sum(share * place[k] for share, place in zip(shares, places, strict=True)) for k in range(2))
        between: Expr | float = HALF
        if any(each.share is not HALF for each in candidates):
            between = sum(share * each.share for share, each in zip(shares, candidates, strict=True))
        return FacePoint((first, second), normal, on, between), x, y

    c, s = OUTERMOST
    one, x0, y0 = choose([c * x + s * y - z / TILT for (x, y), z in zip(places, heights, strict=True)], -FAR * size)
    two, x1, y1 = choose([ca.sqrt((x - x0) ** 2 + (y - y0) ** 2 + least**2) for x, y in places], 2 * least)
    beside = [beyond(x, y, (x0, y0), (x1, y1), least) for x, y in places]
    three, x2, y2 = choose([ca.fmax(out, -FAVOUR * out) for out in beside], least)
    turn = ca.if_else(beyond(x2, y2, (x0, y0), (x1, y1), least) > 0, 1, -1)
    sides = ((x1, y1), (x0, y0)), ((x0, y0), (x2, y2)), ((x2, y2), (x1, y1))
    outside = [[turn * beyond(x, y, *side, least) for x, y in places] for side in sides]
    four, *_ = choose([ca.fmax(ca.fmax(i, j), k) for i, j, k in zip(*outside, strict=True)], least)
    return [one, two, three, four]


def summed(shares: list[Expr], paths: tuple[Parabola, ...]) -> Parabola:
    """Return the sum of shares of paths."""
    total: Parabola = shares[0] * paths[0]
    for share, each in zip(shares[1:], paths[1:], strict=True):
        total = total + share * each
    return total


def beyond(x: Expr, y: Expr, start: tuple[Expr, Expr], end: tuple[Expr, Expr], least: Expr) -> Expr:
    """Return how far a place is to the left of a line; lines shorter than ``least`` have no direction."""
    along, across = end[0] - start[0], end[1] - start[1]
    return (along * (y - start[1]) - across * (x - start[0])) / ca.sqrt(along * along + across * across + least**2)


def corners_over(face: Face, ground: Face, approach: BoxApproach) -> list[FacePoint]:
    """Return the corners of a face over the other."""
    found, t = [], approach.time
    for corner in face.corners():
        away = (corner - ground.centre).at(t)
        x, y = ca.dot(away, ground.u.at(t)), ca.dot(away, ground.v.at(t))
        inside = ca.logic_and(
            ca.fabs(x) <= (1 + RIM_SHARE) * ground.half_u, ca.fabs(y) <= (1 + RIM_SHARE) * ground.half_v
        )
        at_x, at_y = clamp(x, ground.half_u), clamp(y, ground.half_v)
        over = corner + (at_x - x) * ground.u + (at_y - y) * ground.v
        found.append(FacePoint((over, ground.point(at_x, at_y)), ground.normal, inside))
    return found


def clamp(x: Expr, half: Expr) -> Expr:
    """Clamp ``x`` to [-half, half]."""
    return ca.fmin(ca.fmax(x, -half), half)


def edges_across(corners: list[Parabola], ground: Face, approach: BoxApproach, radius: Expr) -> list[Contact]:
    """Return the contacts of ``crossings``, of edges that are round with a radius."""
    found = crossings(corners, ground, approach)
    return [approach.contact(each.points, each.normal, each.on, radius) for each in found]


def crossings(corners: list[Parabola], ground: Face, approach: BoxApproach) -> list[FacePoint]:
    """Return where edges, of a closed polygon or single, enter and leave the region over a face."""
    flat = [seen_along(corner.at(approach.time), ground, approach) for corner in corners]
    found = []
    for k in range(len(corners) if len(corners) > 2 else 1):
        start, end = k, (k + 1) % len(corners)
        (x0, y0), (x1, y1) = flat[start], flat[end]
        across_u, across_v = inside_strip(x0, x1 - x0, ground.half_u), inside_strip(y0, y1 - y0, ground.half_v)
        enters, leaves = ca.fmax(across_u[0], across_v[0]), ca.fmin(across_u[1], across_v[1])
        for share in (enters, leaves):
            on = ca.logic_and(ca.logic_and(share > 0, share < 1), enters < leaves)
            at = ca.fmin(ca.fmax(share, 0), 1)
            point = (1 - at) * corners[start] + at * corners[end]
            foot = ground.point(x0 + at * (x1 - x0), y0 + at * (y1 - y0))
            found.append(FacePoint((point, foot), approach.normal, on))
    return found


def seen_along(point: Expr, ground: Face, approach: BoxApproach) -> tuple[Expr, Expr]:
    """Project a point on a face's plane along the normal of the approach."""
    t, n = approach.time, approach.normal.at(approach.time)
    away, upright = point - ground.centre.at(t), ground.normal.at(t)
    down = away - n * (ca.dot(upright, away) / ca.dot(upright, n))
    return ca.dot(down, ground.u.at(t)), ca.dot(down, ground.v.at(t))


def inside_strip(start: Expr, change: Expr, half: Expr) -> tuple[Expr, Expr]:
    """Return the shares of an edge at which it enters and leaves |x| <= half; an edge along the rim is inside."""
    along = ca.fabs(change) < MIN_EDGE_CHANGE
    pace, wide = ca.if_else(along, MIN_EDGE_CHANGE, change), half + ca.if_else(along, RIM_SHARE * half, 0)
    one, other = (-wide - start) / pace, (wide - start) / pace
    return ca.fmin(one, other), ca.fmax(one, other)
