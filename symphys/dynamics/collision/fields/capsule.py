"""A capsule against a shape whose distance is known everywhere: its ends, and the point of its side that is nearest.

The distance of a convex shape is a convex function along the capsule's axis. Where it is least is found by bisection
of its slope, once where the bodies are and once where they are expected to touch, and stays on the capsule for the
substep.
"""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.body_points import axes, ends, placed
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.signed_distance import Field, ball_in_field
from symphys.model.shapes import Capsule, SolidShape
from symphys.types import Expr

HALVINGS = 8
"""Bisections of the capsule's length before the secant steps."""
SECANTS = 2
"""Last steps, which also carry the derivative of the place."""
TINY_SLOPE = 1e-12
"""Difference of slopes below which a secant step halves."""


def capsule_in_field(
    capsule: Capsule, shape: SolidShape, field: Field, a: PredictedPath, b: PredictedPath
) -> list[Contact]:
    """Return three points: the round ends, and where the side between them is nearest, if that is between them."""
    tips = ends(capsule)
    found = [ball_in_field(a.path(end), a.arm(end), capsule.radius, shape, field, b) for end in tips]
    time, middle = ca.SX(0), None
    far = 4 * (capsule.half_length + capsule.radius)
    for _ in range(2):
        share, between = nearest_share(capsule, shape, field, a, b, time)
        point = placed(capsule, (0.0, 0.0, share * capsule.half_length))
        radius = ca.if_else(between, capsule.radius, -far)
        middle = ball_in_field(a.path(point), a.arm(point), radius, shape, field, b)
        time = middle.time
    assert middle is not None
    return [*found, middle]


def nearest_share(
    capsule: Capsule, shape: SolidShape, field: Field, a: PredictedPath, b: PredictedPath, t: Expr
) -> tuple[Expr, Expr]:
    """Return the nearest place on the axis at time t, from -1 to 1, and 1 if it lies between the ends."""
    # axis of the capsule in the shape's own frame
    own = [axis.at(t) for axis in axes(b, shape)]

    def inside(vector: Expr) -> Expr:
        return ca.vertcat(*(ca.dot(axis, vector) for axis in own))

    centre = inside((a.path(capsule.centre) - b.path(shape.centre)).at(t))
    along = inside(axes(a, capsule)[2].at(t)) * capsule.half_length

    def slope(share: Expr) -> Expr:
        return ca.dot(field.normal(centre + share * along), along)

    # bracket of the root of the slope of the distance along the axis
    low, high = ca.SX(-1), ca.SX(1)
    falls, rises = slope(low), slope(high)
    between = ca.logic_and(falls < 0, rises > 0)
    # bisection, then secant steps, whose derivative is that of the root
    for k in range(HALVINGS + SECANTS):
        steep = ca.logic_and(k >= HALVINGS, rises - falls > TINY_SLOPE)
        secant = low - falls * (high - low) / ca.if_else(steep, rises - falls, 1)
        at = ca.if_else(steep, secant, (low + high) / 2)
        here = slope(at)
        low, falls = ca.if_else(here < 0, at, low), ca.if_else(here < 0, here, falls)
        high, rises = ca.if_else(here < 0, high, at), ca.if_else(here < 0, rises, here)
    share = ca.if_else(-falls < rises, low, high)
    return ca.if_else(between, share, 0), between
