"""The free motion of one body inside a step: known parabolas, in which impacts find their instant.

Time inside the step is t in [0, dt]; t = 0 is t_k. Velocities carried over lag half a step behind, so that the
step reads as leapfrog; see ARCHITECTURE.md, "The time step".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys import rotation
from symphys.world import Body, is_zero

Expr = Any
"""casadi SX, MX or DM"""


@dataclass(frozen=True)
class BodyState:
    """What a body brings into a step: (3,) or (4,) each, world frame, velocities without persistent forces."""

    position: Expr
    orientation: Expr
    velocity: Expr
    angular_momentum: Expr
    force: Expr
    torque: Expr


@dataclass(frozen=True)
class Parabola:
    """A vector's course over the step: start + t velocity + t^2/2 acceleration, (3,) each."""

    start: Expr
    velocity: Expr
    acceleration: Expr

    def at(self, t: Expr) -> Expr:
        """(3,): the vector at time t."""
        return self.start + t * self.velocity + t * t / 2 * self.acceleration

    def velocity_at(self, t: Expr) -> Expr:
        """(3,): its rate at time t."""
        return self.velocity + t * self.acceleration

    def __add__(self, other: Parabola) -> Parabola:
        """The course of the sum."""
        return Parabola(
            self.start + other.start, self.velocity + other.velocity, self.acceleration + other.acceleration
        )

    def __sub__(self, other: Parabola) -> Parabola:
        """The course of the difference."""
        return Parabola(
            self.start - other.start, self.velocity - other.velocity, self.acceleration - other.acceleration
        )


@dataclass(frozen=True)
class Motion:
    """A body's motion in one step if nothing touches it.

    Attributes:
        body: the body.
        position: (3,) [m] at t_k.
        orientation: (4,) at t_k.
        rotation: (3, 3) R_wb at t_k.
        velocity, acceleration: (3,) [m/s], [m/s^2] at t_k.
        angular_velocity, angular_acceleration: (3,) [rad/s], [rad/s^2] at t_k.
        momentum_k: (3,) angular momentum at t_k [N m s].
        torque: (3,) [N m].
        mid_velocity, mid_momentum: (3,) velocity and angular momentum at t_k + dt/2.
        inverse_mid: inverse inertia at t_k + dt/2, world frame: scalar if isotropic, else (3, 3) [1/(kg m^2)].
        inverse_rate: its time derivative; None if isotropic.
        dt: [s].
    """

    body: Body
    position: Expr
    orientation: Expr
    rotation: Expr
    velocity: Expr
    acceleration: Expr
    angular_velocity: Expr
    angular_acceleration: Expr
    momentum_k: Expr
    torque: Expr
    mid_velocity: Expr
    mid_momentum: Expr
    inverse_mid: Expr
    inverse_rate: Expr | None
    dt: Expr

    def inverse_inertia(self, t: Expr) -> Expr:
        """World-frame inverse inertia at time t in the step, to first order; scalar if isotropic."""
        if self.inverse_rate is None:
            return self.inverse_mid
        return self.inverse_mid + (t - self.dt / 2) * self.inverse_rate

    def arm(self, offset: Sequence[Any]) -> Parabola:
        """The course of the body-frame vector ``offset``, in world coordinates."""
        if all(is_zero(c) for c in offset):
            return Parabola(ca.SX.zeros(3), ca.SX.zeros(3), ca.SX.zeros(3))
        arm = ca.mtimes(self.rotation, ca.vertcat(*offset))
        swing = ca.cross(self.angular_velocity, arm)
        bend = ca.cross(self.angular_velocity, swing) + ca.cross(self.angular_acceleration, arm)
        return Parabola(arm, swing, bend)

    def path(self, offset: Sequence[Any]) -> Parabola:
        """The course of the body's point at body-frame ``offset`` from the centre of mass."""
        return Parabola(self.position, self.velocity, self.acceleration) + self.arm(offset)


def isotropic(body: Body) -> bool:
    """Whether the inertia is one number."""
    return not isinstance(body.inertia, (tuple, list)) and ca.SX(body.inertia).is_scalar()


def inertia_matrix(body: Body) -> Expr:
    """(3, 3): inertia in the body frame, from a scalar, three principal moments or a tensor."""
    if isotropic(body):
        return body.inertia * ca.SX.eye(3)
    rows = [ca.vertcat(*row) if isinstance(row, (tuple, list)) else row for row in body.inertia]
    return ca.diag(ca.vertcat(*rows)) if ca.SX(rows[0]).is_scalar() else ca.horzcat(*rows)


def apply(operator: Expr, vector: Expr) -> Expr:
    """A scalar or (3, 3) operator times a vector."""
    return ca.mtimes(operator, vector)


def momentum(body: Body, orientation: Expr, angular_velocity: Expr) -> Expr:
    """(3,): angular momentum I(q) w, world frame [N m s]."""
    if isotropic(body):
        return body.inertia * angular_velocity
    r = rotation.matrix(orientation)
    return ca.mtimes(r, ca.mtimes(inertia_matrix(body), ca.mtimes(r.T, angular_velocity)))


def angular_velocity(body: Body, orientation: Expr, angular_momentum: Expr) -> Expr:
    """(3,): I(q)^-1 L, world frame [rad/s]."""
    return apply(inverse_inertia(body, rotation.matrix(orientation)), angular_momentum)


def inverse_inertia(body: Body, r_wb: Expr) -> Expr:
    """World-frame inverse inertia: a scalar if isotropic, else (3, 3)."""
    if isotropic(body):
        return 1 / body.inertia
    return ca.mtimes(r_wb, ca.mtimes(ca.inv_minor(inertia_matrix(body)), r_wb.T))


def free_motion(body: Body, state: BodyState, gravity: Expr, dt: Expr) -> Motion:
    """The motion from ``state`` under gravity, force and torque, all constant over the step."""
    acceleration = gravity + state.force / body.mass
    mid_momentum = state.angular_momentum + dt / 2 * state.torque
    turned = rotation.matrix(state.orientation)
    w = apply(inverse_inertia(body, turned), state.angular_momentum)
    inverse_rate = None
    inverse_mid = inverse_inertia(body, turned)
    if not isotropic(body):
        middle = rotation.turn(state.orientation, dt / 2 * w)
        inverse_mid = inverse_inertia(body, rotation.matrix(middle))
        spin: Expr = rotation.cross_matrix(apply(inverse_mid, mid_momentum))
        turning: Expr = ca.mtimes(spin, inverse_mid)
        inverse_rate = turning + turning.T
    return Motion(
        body=body,
        position=state.position,
        orientation=state.orientation,
        rotation=turned,
        velocity=state.velocity,
        acceleration=acceleration,
        angular_velocity=w,
        angular_acceleration=(apply(inverse_mid, mid_momentum) - w) * (2 / dt),
        momentum_k=state.angular_momentum,
        torque=state.torque,
        mid_velocity=state.velocity + dt / 2 * acceleration,
        mid_momentum=mid_momentum,
        inverse_mid=inverse_mid,
        inverse_rate=inverse_rate,
        dt=dt,
    )
