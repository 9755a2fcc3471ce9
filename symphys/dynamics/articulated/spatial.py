"""Spatial vectors (6,): (w, v), an angular velocity and the velocity of the body's point at an origin; momenta (l, p).

The origin is the root's centre of mass at the start of a substep. The motion subspace of a joint (6, count) holds the
spatial velocities of its subtree for unit rates of its coordinates.
Featherstone, Rigid Body Dynamics Algorithms (2008), chapters 2 and 6; deviation: where velocities are seen at one time
and momenta counted at another, inertias are not symmetric.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.joints.joint_frames import JointFrames, joint_frames_on
from symphys.dynamics.tracing.decorator import traced
from symphys.maths.rotation import cross_matrix
from symphys.model.joints import Joint
from symphys.types import Expr

Joints = Sequence[Joint | None]
"""The joint of each link; None for a root that floats."""


@traced
def axes_of(joint: Joint | None, sign: int, body_paths: tuple[PredictedPath, ...], t: Expr, origin: Expr) -> Expr:
    """Return the motion subspace of a link at time t (6, count).

    ``body_paths`` of the link's body and of its parent's.
    """
    if joint is None:
        return floating(body_paths[0].centre().at(t) - origin)
    frames = joint_frames_on(joint, body_paths if sign > 0 else body_paths[::-1])
    point = joint_point(frames, t) - origin
    motions = joint.kind.motions(frames.placed(t))
    return ca.horzcat(ca.SX(6, 0), *(sign * ca.vertcat(turn, slide + ca.cross(point, turn)) for slide, turn in motions))


def floating(place: Expr) -> Expr:
    """Return the motion subspace of a root with its centre of mass at ``place``, along the world's axes."""
    unit, zero = ca.SX.eye(3), ca.SX(3, 3)
    return ca.horzcat(ca.vertcat(zero, unit), ca.vertcat(unit, cross_matrix(place)))


def joint_point(frames: JointFrames, t: Expr) -> Expr:
    """Return the point (3,) midway between both frames; that of the first frame for a joint that slides."""
    first, second = (c + a for c, a in zip(frames.centres, frames.arms, strict=True))
    if frames.joint.kind.travels:
        return first.at(t)
    return (first.at(t) + second.at(t)) / 2


def inertia_of(mass: Expr, inertia: Expr, counted: Expr, seen: Expr) -> Expr:
    """Return the spatial inertia (6, 6), with the centre of mass at one place for momenta, at one for velocities.

    ``inertia``: (3, 3) about the centre of mass, world frame.
    """
    here, there = cross_matrix(counted), cross_matrix(seen)
    upper = ca.horzcat(inertia - mass * ca.mtimes(here, there), mass * here)
    return ca.vertcat(upper, ca.horzcat(-mass * there, mass * ca.SX.eye(3)))


def about_origin(place: Expr, linear: Expr, angular: Expr) -> Expr:
    """Return a momentum or force about the origin (6,), from that about ``place``."""
    return ca.vertcat(angular + ca.cross(place, linear), linear)


def at_place(screw: Expr, place: Expr) -> tuple[Expr, Expr]:
    """Return velocity of the body's point at ``place``, and angular velocity."""
    return screw[3:] + ca.cross(screw[:3], place), screw[:3]
