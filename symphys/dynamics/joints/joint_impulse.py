"""What a joint gives: one impulse along each of its directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.contact import constraint as row
from symphys.dynamics.contact.constraint import Side

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


def speeds(sides: tuple[Side, ...], directions: Directions, momenta: tuple[Any, ...]) -> Expr:
    """(n,): how fast the first side moves against the second along the directions."""
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for side, m in zip(sides, momenta, strict=True):
        linear += side.sign * side.speed(m)
        angular += side.sign * side.spin(m)
    return directions.forwards(linear, angular)


def kicked(
    sides: tuple[Side, ...], directions: Directions, momenta: tuple[Any, ...], numbers: Expr, same: bool
) -> tuple[Any, ...]:
    """The momenta after impulses (n,); ``same``: both sides are of one tree of joints."""
    return row.kicked(sides, momenta, *directions.split(numbers), same)


def mobility(sides: tuple[Side, ...], directions: Directions, same: bool) -> Expr:
    """(n, n): the velocities along the directions that unit impulses along them bring about."""
    n = (3 if directions.slides is None else directions.slides.size1()) + directions.turns.size1()
    columns = []
    for k in range(n):
        unit = ca.SX(n, 1)
        unit[k] = 1
        columns.append(speeds(sides, directions, kicked(sides, directions, row.still(sides), unit, same)))
    return ca.horzcat(*columns)
