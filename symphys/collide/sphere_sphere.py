"""A sphere on one body against a sphere on another."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from symphys.collide.contact import Contact, Expr, Frame, Shift, falls, moved
from symphys.motion import Motion, Parabola
from symphys.shapes import Sphere
from symphys.smooth import TINY_SQUARE
from symphys.world import Pair

TINY_LENGTH = 1e-12
"""[m] added along z to a line of centres shorter than half of it, so that coincident spheres have a normal."""
TINY_RATE = 1e-12
"""Below this the squared distance (or the distance) counts as not closing."""
NEWTON_STEPS = 3
"""Corrections of the instant of touch for the relative acceleration."""


def sphere_sphere(pair: Pair, motions: tuple[Motion, Motion], spheres: tuple[Sphere, Sphere]) -> Contact:
    """The contact of two spheres carried along ``motions``."""
    (a, b), (ball_a, ball_b) = motions, spheres
    path_a, path_b = a.path(ball_a.centre), b.path(ball_b.centre)
    arm_a, arm_b = a.arm(ball_a.centre), b.arm(ball_b.centre)
    path = path_a - path_b
    reach = ball_a.radius + ball_b.radius
    gap = _distance(path.start) - reach

    def frame(t: Expr) -> Frame:
        normal = _direction(path.at(t))
        return Frame(normal, (arm_a.at(t) - ball_a.radius * normal, arm_b.at(t) + ball_b.radius * normal))

    def gap_after(shifts: Mapping[int, Shift]) -> Expr:
        assert pair.first.body is not None and pair.second.body is not None
        centre_a = moved(path_a.start, arm_a.start, shifts[pair.first.body])
        centre_b = moved(path_b.start, arm_b.start, shifts[pair.second.body])
        return _distance(centre_a - centre_b) - reach

    return Contact(
        pair=pair,
        gap=gap,
        rate=ca.dot(_direction(path.start), path.velocity),
        hit=_meets(path, reach, a.dt),
        time=first_touch(path, reach, a.dt),
        frame=frame,
        gap_after=gap_after,
    )


def first_touch(path: Parabola, reach: Expr, dt: Expr) -> Expr:
    """The first t in [0, dt] with |path(t)| = reach; 0 when overlapping, dt when there is none.

    Exact for uniform relative motion; relative acceleration enters by Newton steps on |path|^2 - reach^2.
    """
    d, w = path.start, path.velocity
    closing, speed2 = -ca.dot(d, w), ca.dot(w, w)
    excess = ca.dot(d, d) - reach * reach
    root = ca.sqrt(ca.fmax(closing * closing - speed2 * excess, 0) + TINY_SQUARE)
    t = ca.fmin(excess / ca.fmax(closing + root, TINY_RATE), dt)
    for _ in range(NEWTON_STEPS):
        at = path.at(t)
        slope = ca.fmin(2 * ca.dot(at, path.velocity_at(t)), -TINY_RATE)
        t = ca.fmin(ca.fmax(t - (ca.dot(at, at) - reach * reach) / slope, -dt), dt)
    distance = _distance(d)
    return ca.if_else(falls(distance - reach, -closing / distance), t, 0)


def _meets(path: Parabola, reach: Expr, dt: Expr) -> Expr:
    """1 if the spheres overlap at the end of the step, or at their closest approach on the way."""
    closing, speed2 = -ca.dot(path.start, path.velocity), ca.dot(path.velocity, path.velocity)
    nearest = path.at(ca.fmin(ca.fmax(closing, 0) / (speed2 + TINY_SQUARE), dt))
    end = path.at(dt)
    return ca.fmin(ca.dot(nearest, nearest), ca.dot(end, end)) < reach * reach


def _distance(d: Expr) -> Expr:
    lifted = _lifted(d)
    return ca.sqrt(ca.dot(lifted, lifted))


def _direction(d: Expr) -> Expr:
    return _lifted(d) / _distance(d)


def _lifted(d: Expr) -> Expr:
    lift = ca.if_else(4 * ca.dot(d, d) < TINY_LENGTH**2, TINY_LENGTH, 0)
    return d + lift * ca.SX([0, 0, 1])
