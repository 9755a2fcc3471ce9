"""The free motion of one body inside a step: known parabolas, in which impacts find their instant.

Time inside the step is t in [0, dt]; t = 0 is t_k. Velocities carried over lag half a step behind, so that the
step reads as leapfrog; see docs/time_step.md, "2. Predicted motion".
"""

from __future__ import annotations

from dataclasses import fields, replace

import casadi as ca

from symphys.dynamics import free_rotation
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.tracing.decorator import traced
from symphys.maths import rotation
from symphys.maths.rotation import turn
from symphys.records import dataclass
from symphys.types import Expr

MAX_TURN = 4.0
"""[rad] Largest angle by which the paths of a body's points turn in a step: beyond it parabolas leave the circles."""


@dataclass(frozen=True)
class BodyState:
    """State of a body at the start of a step: (3,) or (4,) each, world frame, velocities without persistent forces."""

    position: Expr
    orientation: Expr
    velocity: Expr
    angular_momentum: Expr
    force: Expr
    torque: Expr


@dataclass(frozen=True)
class BodyJacobian:
    """The Jacobian of a body of a kinematic tree with n generalized velocities, and its inverse-mass image.

    Attributes:
        matrix: (6, n) velocity and angular velocity at mid-step for unit generalized velocities.
        inertia: (3, 3) world frame, at mid-step [kg m^2].
        impulse_response, torque_response: (n, 3) of the generalized velocities to unit impulses at the centre of mass,
            and to unit torque impulses.
    """

    matrix: Expr
    inertia: Expr
    impulse_response: Expr
    torque_response: Expr


@dataclass(frozen=True)
class PredictedMotion(PredictedPath):
    """A body's free motion over the step and the inertia that impulses meet.

    Attributes:
        mass, inertia: see ``world.Body``.
        orientation: (4,) at t_k.
        momentum_k: (3,) angular momentum at t_k [N m s].
        torque: (3,) [N m].
        mid_velocity, mid_momentum: (3,) velocity and angular momentum at t_k + dt/2.
        inverse_mid: inverse inertia at t_k + dt/2, world frame: scalar if isotropic, else (3, 3) [1/(kg m^2)].
        inverse_rate: its time derivative; None if isotropic.
        inertia_mid: (3, 3) inertia at t_k + dt/2, world frame [kg m^2].
        path_turn: (3,) each: angular velocity and acceleration, bounded as the paths of the body's points have them.
        jacobian: if the body is part of a tree of joints.
        massless: whether it is a frame between joints. It has the numbers of a body of mass 1 and moment 1 about all
            axes here, without weight, so that its momenta are its velocities; trees do not count them.
    """

    mass: Expr
    inertia: Expr
    orientation: Expr
    momentum_k: Expr
    torque: Expr
    mid_velocity: Expr
    mid_momentum: Expr
    inverse_mid: Expr
    inverse_rate: Expr | None
    inertia_mid: Expr
    path_turn: tuple[Expr, Expr]
    jacobian: BodyJacobian | None = None
    massless: bool = False

    @property
    def counted_mass(self) -> Expr:
        """Return the mass as its tree counts it [kg]."""
        return ca.SX(0) if self.massless else self.mass

    def predicted_path(self) -> PredictedPath:
        """Return the motion without its inertia, which turns by at most ``MAX_TURN`` in the step."""
        path = PredictedPath(**{field.name: getattr(self, field.name) for field in fields(PredictedPath)})
        return replace(path, angular_velocity=self.path_turn[0], angular_acceleration=self.path_turn[1])

    def inverse_inertia(self, t: Expr) -> Expr:
        """Return world-frame inverse inertia at time t in the step, to first order; scalar if isotropic."""
        if self.inverse_rate is None:
            return self.inverse_mid
        return self.inverse_mid + (t - self.dt / 2) * self.inverse_rate

    @traced
    def at_start(self) -> PredictedMotion:
        """Return a copy with the inertia of t = 0 at any time, for impulses there."""
        if self.inverse_rate is None:
            return self
        inverse = inverse_inertia(self.inertia, self.rotation)
        now = in_world(inertia_matrix(self.inertia), self.rotation)
        return replace(self, inverse_mid=inverse, inverse_rate=None, inertia_mid=now)

    def inertia_at(self, t: Expr) -> Expr:
        """Return the inverse of ``inverse_inertia`` (3, 3), world frame."""
        if self.inverse_rate is None or ca.SX(t - self.dt / 2).is_zero():
            return self.inertia_mid
        return ca.inv_minor(self.inverse_inertia(t))


def bounded_turn(angular_velocity: Expr, dt: Expr) -> tuple[Expr, Expr]:
    """Return an angular velocity (3,), at most ``MAX_TURN`` in the time ``dt`` [s], and 1 if it was longer, else 0."""
    square = dt * dt * ca.dot(angular_velocity, angular_velocity)
    fast = square > MAX_TURN**2
    return angular_velocity * ca.if_else(fast, MAX_TURN / ca.sqrt(ca.fmax(square, MAX_TURN**2)), 1), fast


def isotropic(inertia: Expr) -> bool:
    """Whether the inertia is one number."""
    return not isinstance(inertia, (tuple, list)) and ca.SX(inertia).is_scalar()


def inertia_matrix(inertia: Expr) -> Expr:
    """Return the inertia in the body frame (3, 3), from a scalar, three principal moments or a tensor."""
    if isotropic(inertia):
        return inertia * ca.SX.eye(3)
    rows = [ca.vertcat(*row) if isinstance(row, (tuple, list)) else row for row in inertia]
    return ca.diag(ca.vertcat(*rows)) if ca.SX(rows[0]).is_scalar() else ca.horzcat(*rows)


def apply(operator: Expr, vector: Expr) -> Expr:
    """Return a scalar or (3, 3) operator times a vector."""
    return ca.mtimes(operator, vector)


def momentum(inertia: Expr, orientation: Expr, angular_velocity: Expr) -> Expr:
    """Return the angular momentum I(q) w (3,), world frame [N m s]."""
    if isotropic(inertia):
        return inertia * angular_velocity
    r = rotation.matrix(orientation)
    return ca.mtimes(r, ca.mtimes(inertia_matrix(inertia), ca.mtimes(r.T, angular_velocity)))


def angular_velocity(inertia: Expr, orientation: Expr, angular_momentum: Expr) -> Expr:
    """Return the I(q)^-1 L (3,), world frame [rad/s]."""
    return apply(inverse_inertia(inertia, rotation.matrix(orientation)), angular_momentum)


def inverse_inertia(inertia: Expr, r_wb: Expr) -> Expr:
    """Return world-frame inverse inertia: a scalar if isotropic, else (3, 3)."""
    if isotropic(inertia):
        return 1 / inertia
    return in_world(ca.inv_minor(inertia_matrix(inertia)), r_wb)


def in_world(tensor: Expr, r_wb: Expr) -> Expr:
    """Return a symmetric tensor of the body's frame in the world's (3, 3); both halves are the same expressions."""
    return ca.triu2symm(ca.triu(ca.densify(ca.mtimes(r_wb, ca.mtimes(tensor, r_wb.T)))))


def free_motion(
    mass: Expr, inertia: Expr, state: BodyState, gravity: Expr, dt: Expr, jointed: bool = False
) -> PredictedMotion:
    """Return the motion from ``state`` under gravity, force and torque, all constant over the step.

    ``jointed``: whether joints hold the body, so that it does not turn freely.
    """
    turned = rotation.matrix(state.orientation)
    w = apply(inverse_inertia(inertia, turned), state.angular_momentum)
    return motion_from(mass, inertia, state, (turned, w), gravity, dt, jointed)


def motion_from(
    mass: Expr,
    inertia: Expr,
    state: BodyState,
    turning: tuple[Expr, Expr],
    gravity: Expr,
    dt: Expr,
    jointed: bool = True,
) -> PredictedMotion:
    """Predict the motion with a rotation (3, 3) and an angular velocity, ``turning``, in place of ``state``'s."""
    turned, w = turning
    # parabola of the centre of mass (4), and the free momentum at mid-step
    acceleration = gravity + state.force / mass
    mid_momentum = state.angular_momentum + dt / 2 * state.torque
    # orientation and inertia at mid-step, where impulses act
    middle = _middle(inertia, state.orientation, w if jointed else None, mid_momentum, dt / 2)
    inverse_mid, inertia_mid = _inertias(inertia, middle)
    w_mid = apply(inverse_mid, mid_momentum)
    # paths of points turn by at most MAX_TURN, so that parabolas stay near the circles
    (slow, fast), (slow_mid, fast_mid) = bounded_turn(w, dt), bounded_turn(w_mid, dt)
    bend = (w_mid - w) * (2 / dt)
    slow_bend = ca.if_else(ca.logic_or(fast, fast_mid), (slow_mid - slow) * (2 / dt), bend)
    return PredictedMotion(
        position=state.position,
        rotation=turned,
        velocity=state.velocity,
        acceleration=acceleration,
        angular_velocity=w,
        angular_acceleration=bend,
        dt=dt,
        true_velocity=None,
        gravity=gravity,
        mass=mass,
        inertia=inertia,
        orientation=state.orientation,
        momentum_k=state.angular_momentum,
        torque=state.torque,
        mid_velocity=state.velocity + dt / 2 * acceleration,
        mid_momentum=mid_momentum,
        inverse_mid=inverse_mid,
        inverse_rate=None if isotropic(inertia) else _turning(inverse_mid, slow_mid),
        inertia_mid=inertia_mid,
        path_turn=(slow, slow_bend),
    )


def _middle(inertia: Expr, q: Expr, w: Expr | None, momentum: Expr, t: Expr) -> Expr:
    """Return orientation ``q`` (4,) after half a step ``t`` [s], at the angular velocity ``w`` or, for None, freely."""
    if isotropic(inertia):
        return q
    return free_rotation.turned(inertia, q, momentum, t, free_rotation.SECOND_ORDER) if w is None else turn(q, t * w)


def _inertias(inertia: Expr, middle: Expr) -> tuple[Expr, Expr]:
    """Return inverse inertia and inertia at the orientation ``middle``."""
    if isotropic(inertia):
        return 1 / inertia, inertia_matrix(inertia)
    turned = rotation.matrix(middle)
    return inverse_inertia(inertia, turned), in_world(inertia_matrix(inertia), turned)


def _turning(inverse: Expr, angular_velocity: Expr) -> Expr:
    """Return the time derivative (3, 3) of an inverse inertia as its body turns [1/(kg m^2 s)]."""
    changing: Expr = ca.mtimes(rotation.cross_matrix(angular_velocity), inverse)
    return changing + changing.T
