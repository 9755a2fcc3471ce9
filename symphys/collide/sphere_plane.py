"""A sphere on a body against a static plane."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from symphys.collide.contact import Contact, Expr, Frame, Shift, falls, moved
from symphys.motion import Motion
from symphys.shapes import Plane, Sphere
from symphys.smooth import TINY_SQUARE
from symphys.world import Pair

TINY_RATE = 1e-12
"""[m/s] below which the surfaces count as not closing."""


def sphere_plane(pair: Pair, motion: Motion, sphere: Sphere, plane: Plane) -> Contact:
    """The contact of ``sphere``, carried along ``motion``, with ``plane``."""
    normal = ca.vertcat(*plane.normal)
    path, arm = motion.path(sphere.centre), motion.arm(sphere.centre)
    gap = ca.dot(normal, path.start) - plane.offset - sphere.radius
    rate = ca.dot(normal, path.velocity)
    bend = ca.dot(normal, path.acceleration)
    dt = motion.dt

    def frame(t: Expr) -> Frame:
        return Frame(normal, (arm.at(t) - sphere.radius * normal, ca.SX.zeros(3)))

    def gap_after(shifts: Mapping[int, Shift]) -> Expr:
        assert pair.first.body is not None
        centre = moved(path.start, arm.start, shifts[pair.first.body])
        return ca.dot(normal, centre) - plane.offset - sphere.radius

    return Contact(
        pair=pair,
        gap=gap,
        rate=rate,
        hit=gap + dt * rate + dt * dt / 2 * bend < 0,
        time=first_root(gap, rate, bend, dt),
        frame=frame,
        gap_after=gap_after,
    )


def first_root(gap: Expr, rate: Expr, bend: Expr, dt: Expr) -> Expr:
    """The first t in [0, dt] with gap + rate t + bend t^2/2 = 0; 0 when overlapping, dt when there is none."""
    discriminant = ca.fmax(rate * rate - 2 * bend * gap, 0)
    closing = ca.fmax(ca.sqrt(discriminant + TINY_SQUARE) - rate, TINY_RATE)
    return ca.fmin(ca.if_else(falls(gap, rate), 2 * gap, 0) / closing, dt)
