"""A sphere on one body against a sphere on another."""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact, Displacement, Frame
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.dynamics.collision.time_of_impact import MIN_CLOSING_SPEED, NEWTON_STEPS, approaches, clip_to_end
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.shapes import Sphere
from symphys.records import dataclass
from symphys.types import Expr

TINY_LENGTH = 1e-12
"""[m] added along z to a line of centres shorter than half of it, so that coincident spheres have a normal."""


@dataclass(frozen=True)
class OnSphere:
    """Two spheres: paths and arms of their centres, radii [m]."""

    paths: tuple[Parabola, Parabola]
    arms: tuple[Parabola, Parabola]
    radii: tuple[Expr, Expr]

    def frame(self, t: Expr) -> Frame:
        """Implement ``ContactGeometry.frame``."""
        (a, b), (arm_a, arm_b), (r_a, r_b) = self.paths, self.arms, self.radii
        normal = direction((a - b).at(t))
        return Frame(normal, (arm_a.at(t) - r_a * normal, arm_b.at(t) + r_b * normal))

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Implement ``ContactGeometry.gap_after``."""
        (a, b), (arm_a, arm_b) = self.paths, self.arms
        apart = first.moved(a.start, arm_a.start) - second.moved(b.start, arm_b.start)
        return distance(apart) - self.radii[0] - self.radii[1]


def sphere_sphere(ball_a: Sphere, ball_b: Sphere, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    paths = a.path(ball_a.centre), b.path(ball_b.centre)
    path, reach = paths[0] - paths[1], ball_a.radius + ball_b.radius
    return [
        Contact(
            gap=distance(path.start) - reach,
            rate=ca.dot(direction(path.start), path.velocity),
            hit=_meets(path, reach, a.dt),
            time=first_touch(path, reach, a.dt),
            end=distance(path.at(a.dt)) - reach,
            geometry=OnSphere(paths, (a.arm(ball_a.centre), b.arm(ball_b.centre)), (ball_a.radius, ball_b.radius)),
        )
    ]


def first_touch(path: Parabola, reach: Expr, dt: Expr) -> Expr:
    """Return the first t in [0, dt] with |path(t)| = reach; 0 when overlapping, dt when there is none.

    Exact for uniform relative motion; relative acceleration enters by Newton steps on |path|^2 - reach^2.
    """
    d, w = path.start, path.velocity
    closing, speed2 = -ca.dot(d, w), ca.dot(w, w)
    excess = ca.dot(d, d) - reach * reach
    root = ca.sqrt(ca.fmax(closing * closing - speed2 * excess, 0) + TINY_SQUARE)
    t = clip_to_end(excess / ca.fmax(closing + root, MIN_CLOSING_SPEED), dt)
    for _ in range(NEWTON_STEPS):
        at = path.at(t)
        slope = ca.fmin(2 * ca.dot(at, path.velocity_at(t)), -MIN_CLOSING_SPEED)
        t = clip_to_end(ca.fmax(t - (ca.dot(at, at) - reach * reach) / slope, -dt), dt)
    apart = distance(d)
    return ca.if_else(approaches(apart - reach, -closing / apart), t, 0)


def _meets(path: Parabola, reach: Expr, dt: Expr) -> Expr:
    """Return 1 if the spheres overlap at the end of the step, or at their closest approach on the way."""
    closing, speed2 = -ca.dot(path.start, path.velocity), ca.dot(path.velocity, path.velocity)
    nearest = path.at(ca.fmin(ca.fmax(closing, 0) / (speed2 + TINY_SQUARE), dt))
    end = path.at(dt)
    return ca.fmin(ca.dot(nearest, nearest), ca.dot(end, end)) < reach * reach


def distance(d: Expr) -> Expr:
    """Return |d|, never zero."""
    lifted = _lifted(d)
    return ca.sqrt(ca.dot(lifted, lifted))


def direction(d: Expr) -> Expr:
    """Return the unit vector d / |d| (3,); z where d is zero."""
    return _lifted(d) / distance(d)


def _lifted(d: Expr) -> Expr:
    lift = ca.if_else(4 * ca.dot(d, d) < TINY_LENGTH**2, TINY_LENGTH, 0)
    return d + lift * ca.SX([0, 0, 1])
