"""A capsule on one body against a capsule on another.

Where both touch between their ends, along the common perpendicular of their axes; else with a round end. Capsules
that lie side by side touch with the ends that overlap, so that they rest on each other.
"""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.body_points import axes, ends
from symphys.dynamics.collision.contact_geometry import Contact, flipped
from symphys.dynamics.collision.pairs.sphere_capsule import ball_at_capsule
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath, chosen
from symphys.dynamics.collision.time_of_impact import contact_along
from symphys.dynamics.collision.witness_points import Witness, contact_of, steady
from symphys.maths.smoothing import length
from symphys.model.shapes import Capsule
from symphys.types import Expr

PARALLEL = 1e-6
"""Square of the sine of the angle below which axes count as parallel."""


def capsule_capsule(first: Capsule, second: Capsule, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return five points: the ends of the first, the ends of the second, and between."""
    return [
        *on_capsule(first, second, a, b),
        *map(flipped, on_capsule(second, first, b, a)),
        crossing(first, second, a, b),
    ]


def on_capsule(first: Capsule, second: Capsule, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return the round ends of the first against the second."""
    return [ball_at_capsule(a.path(end), a.arm(end), first.radius, second, b) for end in ends(first)]


def crossing(first: Capsule, second: Capsule, a: PredictedPath, b: PredictedPath) -> Contact:
    """Return the contact between the ends of both; off where the nearest points are ends or the axes parallel."""
    centres, lines = (a.path(first.centre), b.path(second.centre)), (axes(a, first)[2], axes(b, second)[2])
    apart, across = centres[0] - centres[1], lines[0].cross(lines[1])
    parallel = ca.dot(across.start, across.start) < PARALLEL
    upright = Parabola(ca.SX([0, 0, 1]), ca.SX.zeros(3), ca.SX.zeros(3))
    sign = ca.if_else(ca.dot(across.start, apart.start) >= 0, 1, -1)
    normal = steady(chosen(parallel, upright, sign * across), 0, a.dt)
    reach = first.radius + second.radius
    far = length(apart.start) + reach
    # the gap along the common perpendicular is the same from any points of the two axes
    anywhere = Witness(centres, centres, normal, (first.radius, second.radius), parallel, far, a.dt)
    time = contact_along(anywhere, a.dt).time
    s, u = nearest(apart.at(time), lines[0].at(time), lines[1].at(time))
    outside = ca.logic_or(ca.fabs(s) > first.half_length, ca.fabs(u) > second.half_length)
    points = centres[0] + s * lines[0], centres[1] + u * lines[1]
    arms = points[0] - a.centre(), points[1] - b.centre()
    off = ca.logic_or(parallel, outside)
    return contact_of(Witness(points, arms, normal, (first.radius, second.radius), off, far, a.dt))


def nearest(apart: Expr, one: Expr, other: Expr) -> tuple[Expr, Expr]:
    """Return where two lines are nearest, along each from its centre [m]; ``apart``: between the centres."""
    cosine = ca.dot(one, other)
    square = ca.fmax(1 - cosine * cosine, PARALLEL / 2)
    along, along_other = ca.dot(apart, one), ca.dot(apart, other)
    return (cosine * along_other - along) / square, (along_other - cosine * along) / square
