"""A box on one body against a box on another, or a static one.

Each box turns one face to the other: the one whose normal is nearest to the direction along which they are farthest
apart when they meet. The candidates are the corners of these two faces over the other face, and the points where
edges of the one cross edges of the other: the corners of the region that both faces cover. They are chosen where the
boxes are expected to meet, or at the end of the step. A box that slides over the seam of two boards meets their tops
alone (``box_geometry.first_overlap``).

What it cannot do: two pairs of faces that meet in the same step; boxes that have sunk into each other deeper than
about half of the thinner one may be pushed out at another side. Where edges cross, the point of contact stays where it
was on both bodies for the rest of the step.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from symphys.dynamics.collision.box_geometry import (
    BoxOverlap,
    Face,
    faces_and_edges,
    first_overlap,
    moving_box,
    nearest_face,
)
from symphys.dynamics.collision.contact_geometry import Contact, flipped
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.dynamics.collision.witness_points import Witness, contact_of
from symphys.model.shapes import Box
from symphys.records import dataclass
from symphys.types import Expr

RIM_SHARE = 0.001
"""Share of a face's size by which a corner may lie beyond its rim and count as a point of the rim. So no candidate
appears or disappears as boxes that lie flush creep by rounding; it is given up only where others have long been at the
same place."""
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

    def contact(self, points: tuple[Parabola, Parabola], normal: Parabola, on: Expr, radius: Expr = 0.0) -> Contact:
        """Return the midpoint of two points."""
        arms = points[0] - self.bodies[0].centre(), points[1] - self.bodies[1].centre()
        met = contact_of(Witness(points, arms, normal, (radius, 0.0), ca.logic_not(on), self.far, self.bodies[0].dt))
        return replace(met, hit=ca.logic_and(met.hit, ca.logic_not(self.apart)))

    def flipped(self) -> BoxApproach:
        """Return the approach as seen from the other box."""
        return replace(self, bodies=(self.bodies[1], self.bodies[0]), normal=-1 * self.normal)


def approach_of(near: BoxOverlap, bodies: tuple[PredictedPath, PredictedPath], size: Expr) -> BoxApproach:
    """Make the geometry of two boxes."""
    return BoxApproach(bodies, near.direction, near.time, near.apart, ca.fmax(near.distance, 0) + size)


def box_box(first: Box, second: Box, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return sixteen points: the corners of each face over the other, and where their edges cross."""
    one, other = moving_box(first, a), moving_box(second, b)
    near = first_overlap(one, other, *faces_and_edges(one, other), a.dt)
    approach = approach_of(near, (a, b), sum(first.half_sizes) + sum(second.half_sizes))
    normal, time = approach.normal.at(near.time), near.time
    face, ground = nearest_face(one, -normal, time), nearest_face(other, normal, time)
    return [
        *corners_over(face, ground, approach),
        *map(flipped, corners_over(ground, face, approach.flipped())),
        *edges_across(face.corners(), ground, approach),
    ]


def corners_over(face: Face, ground: Face, approach: BoxApproach) -> list[Contact]:
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
        found.append(approach.contact((over, ground.point(at_x, at_y)), ground.normal, inside))
    return found


def clamp(x: Expr, half: Expr) -> Expr:
    """Clamp ``x`` to [-half, half]."""
    return ca.fmin(ca.fmax(x, -half), half)


def edges_across(corners: list[Parabola], ground: Face, approach: BoxApproach, radius: Expr = 0.0) -> list[Contact]:
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
            found.append(approach.contact((point, foot), approach.normal, on, radius))
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
