"""What a joint gives: one impulse along each of its directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.motion import apply
from symphys.step.momentum import Momenta, Momentum
from symphys.step.row import Side

Expr = Any
"""casadi SX"""


@dataclass(frozen=True)
class Along:
    """Impulses (n,) on the first side [N s] or [N m s], along a row's directions."""

    numbers: Expr

    def plus(self, other: Along) -> Along:
        """The sum."""
        return Along(self.numbers + other.numbers)

    def minus(self, other: Along) -> Along:
        """The difference."""
        return Along(self.numbers - other.numbers)

    def times(self, factor: Expr) -> Along:
        """A share of it."""
        return Along(factor * self.numbers)


@dataclass(frozen=True)
class Directions:
    """Where impulses act and what they change, world frame.

    Attributes:
        slides: (m, 3) unit vectors of impulses through the common point; None: the world's three.
        turns: (k, 3) unit vectors of torque impulses.
    """

    slides: Expr | None
    turns: Expr

    def forwards(self, linear: Expr, angular: Expr) -> Expr:
        """(n,): the parts of a velocity along the directions."""
        return ca.vertcat(linear if self.slides is None else ca.mtimes(self.slides, linear), self.of(angular))

    def of(self, angular: Expr) -> Expr:
        """(k,): the parts of an angular velocity."""
        return ca.mtimes(self.turns, angular)

    def split(self, numbers: Expr) -> tuple[Expr, Expr]:
        """(3,), (3,): the linear and the angular impulse that numbers (n,) stand for."""
        m = 3 if self.slides is None else self.slides.size1()
        linear = numbers[:m, 0] if self.slides is None else ca.mtimes(self.slides.T, numbers[:m, 0])
        return linear, ca.mtimes(self.turns.T, numbers[m:, 0])


def speeds(sides: tuple[Side, ...], directions: Directions, momenta: Momenta) -> Expr:
    """(n,): how fast the first side moves against the second along the directions."""
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for side, m in zip(sides, momenta, strict=True):
        spin = apply(side.inverse_inertia, m.angular)
        linear += side.sign * (m.velocity + ca.cross(spin, side.arm))
        angular += side.sign * spin
    return directions.forwards(linear, angular)


def kicked(sides: tuple[Side, ...], directions: Directions, momenta: Momenta, numbers: Expr) -> Momenta:
    """The momenta after impulses (n,)."""
    linear, angular = directions.split(numbers)
    return tuple(
        Momentum(
            m.velocity + side.sign * side.inverse_mass * linear,
            m.angular + side.sign * (ca.cross(side.impulse_arm, linear) + angular),
        )
        for side, m in zip(sides, momenta, strict=True)
    )


def mobility(sides: tuple[Side, ...], directions: Directions) -> Expr:
    """(n, n): the velocities along the directions that unit impulses along them bring about, at the row's instant."""
    n = (3 if directions.slides is None else directions.slides.size1()) + directions.turns.size1()
    columns = []
    for k in range(n):
        unit = ca.SX(n, 1)
        unit[k] = 1
        linear, angular = directions.split(unit)
        total = ca.SX(n, 1)
        for side in sides:
            spin = apply(side.inverse_inertia, ca.cross(side.arm, linear) + angular)
            total += directions.forwards(side.inverse_mass * linear + ca.cross(spin, side.arm), spin)
        columns.append(total)
    return ca.horzcat(*columns)
