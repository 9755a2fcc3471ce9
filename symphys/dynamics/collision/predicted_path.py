"""Known paths inside a step: where a body and its points are, as parabolas of the time t in [0, dt]."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.maths.inlined import inlined
from symphys.model.scalar import is_zero
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class Parabola:
    """A vector's path over the step: start + t velocity + t^2/2 acceleration, (3,) each."""

    start: Expr
    velocity: Expr
    acceleration: Expr

    def at(self, t: Expr) -> Expr:
        """Return the vector at time t (3,)."""
        return _parabola(self.start, self.velocity, self.acceleration, t)

    def velocity_at(self, t: Expr) -> Expr:
        """Return its rate at time t (3,)."""
        return self.velocity + t * self.acceleration

    def __add__(self, other: Parabola) -> Parabola:
        """Return the path of the sum."""
        return Parabola(
            self.start + other.start, self.velocity + other.velocity, self.acceleration + other.acceleration
        )

    def __sub__(self, other: Parabola) -> Parabola:
        """Return the path of the difference."""
        return self + -1 * other

    def __rmul__(self, factor: Expr) -> Parabola:
        """Return the path of a multiple."""
        return Parabola(factor * self.start, factor * self.velocity, factor * self.acceleration)

    def cross(self, other: Parabola) -> Parabola:
        """Return the path of the cross product, to second order."""
        bend = ca.cross(self.acceleration, other.start) + ca.cross(self.start, other.acceleration)
        return Parabola(
            ca.cross(self.start, other.start),
            ca.cross(self.velocity, other.start) + ca.cross(self.start, other.velocity),
            bend + 2 * ca.cross(self.velocity, other.velocity),
        )


@inlined(3, 3, 3, 1)
def _parabola(start: Expr, velocity: Expr, acceleration: Expr, t: Expr) -> Expr:
    return start + t * velocity + t * t / 2 * acceleration


ZERO_PATH = Parabola(ca.SX.zeros(3), ca.SX.zeros(3), ca.SX.zeros(3))
"""The path of a vector that is zero."""


def chosen(condition: Expr, one: Parabola, other: Parabola) -> Parabola:
    """Return the first path where the condition is 1, else the other."""
    return Parabola(
        ca.if_else(condition, one.start, other.start),
        ca.if_else(condition, one.velocity, other.velocity),
        ca.if_else(condition, one.acceleration, other.acceleration),
    )


@dataclass(frozen=True)
class PredictedPath:
    """A body's pose over the step.

    Attributes:
        position: (3,) at t_k [m].
        rotation: (3, 3) R_wb at t_k.
        velocity, acceleration: (3,) [m/s], [m/s^2] at t_k.
        angular_velocity, angular_acceleration: (3,) [rad/s], [rad/s^2] at t_k.
        dt: length of the step [s].
        true_velocity: (3,) at t_k, of which ``velocity`` may lack what persistent forces gave it in the last half
            step [m/s]; None: it lacks nothing.
        gravity: (3,) [m/s^2]; None: there is no up and down.
    """

    position: Expr
    rotation: Expr
    velocity: Expr
    acceleration: Expr
    angular_velocity: Expr
    angular_acceleration: Expr
    dt: Expr
    true_velocity: Expr | None
    gravity: Expr | None

    def arm(self, offset: Sequence[Any]) -> Parabola:
        """Return the path of the body-frame vector ``offset``, in world coordinates."""
        if all(is_zero(c) for c in offset):
            return ZERO_PATH
        arm = ca.mtimes(self.rotation, ca.vertcat(*offset))
        swing = ca.cross(self.angular_velocity, arm)
        bend = ca.cross(self.angular_velocity, swing) + ca.cross(self.angular_acceleration, arm)
        return Parabola(arm, swing, bend)

    def centre(self) -> Parabola:
        """Return the path of the centre of mass."""
        return Parabola(self.position, self.velocity, self.acceleration)

    def true_velocity_of(self, offset: Sequence[Any]) -> Expr:
        """Return the true velocity at t_k of the body's point at body-frame ``offset`` [m/s] (3,)."""
        return (self.velocity if self.true_velocity is None else self.true_velocity) + self.arm(offset).velocity

    def path(self, offset: Sequence[Any]) -> Parabola:
        """Return the path of the body's point at body-frame ``offset`` from the centre of mass."""
        return self.centre() + self.arm(offset)


class StillPath(PredictedPath):
    """The path of a body that is looked at in one instant: its velocities are zero."""

    def arm(self, offset: Sequence[Any]) -> Parabola:
        """Implement ``PredictedPath.arm`` without products with zero."""
        if all(is_zero(c) for c in offset):
            return ZERO_PATH
        return Parabola(ca.mtimes(self.rotation, ca.vertcat(*offset)), ZERO_PATH.velocity, ZERO_PATH.acceleration)


def at_rest(dt: Expr) -> PredictedPath:
    """Return the path of what is static: its frame is the world's."""
    zero = ca.SX.zeros(3)
    return PredictedPath(zero, ca.SX.eye(3), zero, zero, zero, zero, dt, None, None)
