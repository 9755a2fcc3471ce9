"""What a contact gives, and one visit of a sweep to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca

from symphys.dynamics.contact import local_solver as coupled
from symphys.dynamics.momentum import States
from symphys.maths.smoothing import onto_disc, positive

if TYPE_CHECKING:
    from symphys.dynamics.contact.constraint import ContactRow

Expr = Any
"""casadi SX, MX or DM"""


@dataclass(frozen=True)
class Impulse:
    """What a contact has given so far, on the pair's first body, world frame.

    Attributes:
        normal: along the normal [N s], >= 0.
        tangent: (3,) friction [N s].
        spin: torque impulse about the normal [N m s].
        roll: (3,) torque impulse across the normal [N m s].
    """

    normal: Expr
    tangent: Expr
    spin: Expr
    roll: Expr

    def linear(self, n: Expr) -> Expr:
        """(3,) [N s]."""
        return n * self.normal + self.tangent

    def angular(self, n: Expr) -> Expr:
        """(3,) [N m s]: the torque impulse beside that of the linear one."""
        return n * self.spin + self.roll

    def plus(self, other: Impulse) -> Impulse:
        """The sum."""
        return Impulse(
            self.normal + other.normal, self.tangent + other.tangent, self.spin + other.spin, self.roll + other.roll
        )

    def times(self, factor: Expr) -> Impulse:
        """A share of it."""
        return Impulse(factor * self.normal, factor * self.tangent, factor * self.spin, factor * self.roll)

    def minus(self, other: Impulse) -> Impulse:
        """The difference."""
        return Impulse(
            self.normal - other.normal, self.tangent - other.tangent, self.spin - other.spin, self.roll - other.roll
        )


ZERO = Impulse(ca.SX(0), ca.SX.zeros(3), ca.SX(0), ca.SX.zeros(3))


def give(row: ContactRow, momenta: States, impulse: Impulse) -> States:
    """The momenta of the row's bodies after an impulse."""
    linear, angular = impulse.linear(row.impulse_normal), impulse.angular(row.impulse_normal)
    return row.kicked(momenta, linear, angular)


def visit(row: ContactRow, momenta: States, old: Impulse) -> tuple[States, Impulse]:
    """One projection of each of the row's impulses, one after the other."""
    zero = ca.SX.zeros(3)
    normal, tangent = _pressed(row, row.slip(momenta), old)
    momenta = give(row, momenta, Impulse(normal - old.normal, tangent - old.tangent, ca.SX(0), zero))
    if not row.law.spins:
        return momenta, Impulse(normal, tangent, old.spin, old.roll)
    spin, roll = _torques(row, momenta, old, normal)
    momenta = give(row, momenta, Impulse(ca.SX(0), zero, spin - old.spin, roll - old.roll))
    return momenta, Impulse(normal, tangent, spin, roll)


def _pressed(row: ContactRow, slip: Expr, old: Impulse) -> tuple[Expr, Expr]:
    """The normal impulse and that of friction."""
    if row.coupling is not None:
        exact, rounded = (by(row, row.coupling, slip, old) for by in (coupled.solve, coupled.smooth))
        smooth = row.knob > 0
        return ca.if_else(smooth, rounded[0], exact[0]), ca.if_else(smooth, rounded[1], exact[1])
    normal = _normal(row, slip, old)
    return normal, _tangent(row, slip + row.answer * (normal - old.normal), old, normal)


def _normal(row: ContactRow, slip: Expr, old: Impulse) -> Expr:
    """ln <- max(ln - m (n.u - b + gamma ln), 0), m = 1 / (k + gamma)."""
    wanted = ca.dot(row.normal, slip) - row.target + row.softness * old.normal
    return positive(old.normal - row.normal_mass * wanted, row.normal_mass * row.width)


def _tangent(row: ContactRow, slip: Expr, old: Impulse, normal: Expr) -> Expr:
    """The friction impulse, onto the disc of radius mu ln."""
    wanted = old.tangent - row.tangent_mass * _across(slip - row.slip_target, row.normal)
    return onto_disc(wanted, row.law.friction * normal, row.tangent_mass * row.knob, row.knob)


def _torques(row: ContactRow, momenta: States, old: Impulse, normal: Expr) -> tuple[Expr, Expr]:
    """Torsional friction (an interval) and rolling friction (a disc), both limited by the normal impulse."""
    n = row.normal
    spin_width, roll_width = row.knob * row.spin_mass, row.knob * row.roll_mass
    rate = sum(side.sign * side.spin(m) for side, m in zip(row.sides, momenta, strict=True))
    twist = n * (old.spin - row.spin_mass * ca.dot(n, rate))
    spin = ca.dot(n, onto_disc(twist, row.law.torsion * normal, spin_width, row.knob))
    wanted = old.roll - row.roll_mass * _across(rate, n)
    roll = onto_disc(wanted, row.law.rolling * normal, roll_width, row.knob)
    return spin, roll


def _across(a: Expr, n: Expr) -> Expr:
    return a - n * ca.dot(n, a)
