"""The impulse of a joint: a component along each of its directions."""

from __future__ import annotations

from typing import Any

import casadi as ca

from symphys.dynamics.contact import body_term
from symphys.dynamics.contact.body_term import BodyTerm
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class JointImpulse:
    """Impulses (n,) on the first body [N s] or [N m s], along a constraint's directions."""

    numbers: Expr

    @property
    def count(self) -> int:
        """Return the number of components."""
        return int(self.numbers.shape[0])

    def like(self, numbers: Expr) -> JointImpulse:
        """Return a joint impulse of other numbers (n,)."""
        return JointImpulse(numbers)

    def plus(self, other: JointImpulse) -> JointImpulse:
        """Return the sum."""
        return JointImpulse(self.numbers + other.numbers)

    def minus(self, other: JointImpulse) -> JointImpulse:
        """Return the difference."""
        return JointImpulse(self.numbers - other.numbers)

    def times(self, factor: Expr) -> JointImpulse:
        """Return the impulse times a factor."""
        return JointImpulse(factor * self.numbers)


@dataclass(frozen=True)
class Directions:
    """Directions of impulses and of the velocities that they change, world frame.

    Attributes:
        slides: (m, 3) unit vectors of impulses through the common point; None: the world's three.
        turns: (k, 3) unit vectors of torque impulses.
        leads: (m, 3) torque impulses that go with those of ``slides``, as in a screw; None: none.
    """

    slides: Expr | None
    turns: Expr
    leads: Expr | None = None

    def forwards(self, linear: Expr, angular: Expr) -> Expr:
        """Return the parts of a velocity along the directions (n,)."""
        along = linear if self.slides is None else ca.mtimes(self.slides, linear)
        return ca.vertcat(along if self.leads is None else along + ca.mtimes(self.leads, angular), self.of(angular))

    def of(self, angular: Expr) -> Expr:
        """Return the parts of an angular velocity (k,)."""
        return ca.mtimes(self.turns, angular)

    def split(self, numbers: Expr) -> tuple[Expr, Expr]:
        """Return the linear (3,) and the angular impulse (3,) of numbers (n,)."""
        m = 3 if self.slides is None else self.slides.size1()
        linear = numbers[:m, 0] if self.slides is None else ca.mtimes(self.slides.T, numbers[:m, 0])
        angular = ca.mtimes(self.turns.T, numbers[m:, 0])
        return linear, angular if self.leads is None else angular + ca.mtimes(self.leads.T, numbers[:m, 0])


NO_DIRECTIONS = Directions(None, ca.SX(0, 3))
"""Stand for directions where only the law of a constraint counts."""


def speeds(terms: tuple[BodyTerm, ...], directions: Directions, momenta: tuple[Any, ...]) -> Expr:
    """Return how fast the first body moves against the second along the directions (n,)."""
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for term, m in zip(terms, momenta, strict=True):
        linear += term.sign * term.speed(m)
        angular += term.sign * term.spin(m)
    return directions.forwards(linear, angular)


def apply_impulse(
    terms: tuple[BodyTerm, ...], directions: Directions, momenta: tuple[Any, ...], numbers: Expr, same: bool
) -> tuple[Any, ...]:
    """Return the momenta after impulses (n,); ``same``: both bodies are of one tree of joints."""
    return body_term.apply_impulse(terms, momenta, *directions.split(numbers), same)


def mobility(terms: tuple[BodyTerm, ...], directions: Directions, same: bool) -> Expr:
    """Return the velocities along the directions that unit impulses along them bring about (n, n)."""
    n = (3 if directions.slides is None else directions.slides.size1()) + directions.turns.size1()
    columns = []
    for k in range(n):
        unit = ca.SX(n, 1)
        unit[k] = 1
        columns.append(speeds(terms, directions, apply_impulse(terms, directions, body_term.still(terms), unit, same)))
    return ca.horzcat(*columns)
