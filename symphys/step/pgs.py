"""Projected Gauss-Seidel over contact rows, on linear velocities and angular momenta.

Cost of a sweep: one visit to each row; nothing but V, L and the impulses is accumulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.motion import apply
from symphys.smooth import onto_disc, positive
from symphys.step.record import Keep
from symphys.step.row import ContactRow, Side
from symphys.step.scene import Scene

Expr = Any
"""casadi SX, MX or DM"""


@dataclass
class Momenta:
    """The sweeps' unknowns, changed in place: V (3,) [m/s] and L (3,) [N m s] of each body at mid-step."""

    velocity: list[Expr]
    angular: list[Expr]

    def kept(self, keep: Keep, row: ContactRow, impulse: Impulse) -> Impulse:
        """Keep what a visit of the row has changed: its bodies' momenta and its impulse."""
        bodies = [side.body for side in row.sides]
        changed = [(self.velocity[i], self.angular[i]) for i in bodies]
        changed, impulse = keep((changed, impulse))
        for i, (velocity, angular) in zip(bodies, changed, strict=True):
            self.velocity[i], self.angular[i] = velocity, angular
        return impulse


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

    def minus(self, other: Impulse) -> Impulse:
        """The difference."""
        return Impulse(
            self.normal - other.normal, self.tangent - other.tangent, self.spin - other.spin, self.roll - other.roll
        )


Solution = tuple[Momenta, list[Impulse], list[Impulse]]
ZERO = Impulse(ca.SX(0), ca.SX.zeros(3), ca.SX(0), ca.SX.zeros(3))


def relax(
    scene: Scene, rows: Sequence[ContactRow], momenta: Momenta, impulses: Sequence[Impulse]
) -> tuple[Momenta, list[Impulse], list[Impulse]]:
    """All sweeps; returns the momenta, the impulses, and the impulses before the last sweep."""

    def once(state: Solution) -> Solution:
        momenta, impulses, _ = state
        momenta = Momenta(list(momenta.velocity), list(momenta.angular))
        return momenta, sweep(scene.keep, rows, momenta, impulses), impulses

    solution: Solution = scene.repeat(scene.scheme.sweeps, once, (momenta, list(impulses), list(impulses)))
    return solution


def sweep(keep: Keep, rows: Sequence[ContactRow], momenta: Momenta, impulses: Sequence[Impulse]) -> list[Impulse]:
    """One pass over all rows; returns the new impulses."""
    new = list(impulses)
    for k in visiting_order(rows):
        new[k] = momenta.kept(keep, rows[k], _visit(rows[k], momenta, impulses[k]))
    return new


def visiting_order(rows: Sequence[ContactRow]) -> list[int]:
    """Rows one after the other that share no body as far as may be: a processor works on several visits at once."""
    order: list[int] = []
    left = list(range(len(rows)))
    busy: set[int] = set()
    while left:
        free = (k for k in left if not busy & {side.body for side in rows[k].sides})
        k = next(free, left[0])
        busy = {side.body for side in rows[k].sides}
        left.remove(k)
        order.append(k)
    return order


def begin(keep: Keep, rows: Sequence[ContactRow], momenta: Momenta, impulses: Sequence[Impulse]) -> list[Impulse]:
    """Give the impulses that the sweeps start from."""
    started = []
    for row, impulse in zip(rows, impulses, strict=True):
        give(row, momenta, impulse)
        started.append(momenta.kept(keep, row, impulse))
    return started


def give(row: ContactRow, momenta: Momenta, impulse: Impulse) -> None:
    """Apply an impulse to the row's bodies."""
    linear, angular = impulse.linear(row.impulse_normal), impulse.angular(row.impulse_normal)
    for side in row.sides:
        momenta.velocity[side.body] += side.sign * side.inverse_mass * linear
        momenta.angular[side.body] += side.sign * (ca.cross(side.impulse_arm, linear) + angular)


def _visit(row: ContactRow, momenta: Momenta, old: Impulse) -> Impulse:
    normal = _normal(row, momenta, old)
    tangent = _tangent(row, momenta, old, normal)
    spin, roll = _torques(row, momenta, old, normal)
    return Impulse(normal, tangent, spin, roll)


def _normal(row: ContactRow, momenta: Momenta, old: Impulse) -> Expr:
    """ln <- max(ln - m (n.u - b + gamma ln), 0), m = 1 / (k + gamma)."""
    wanted = ca.dot(row.normal, _slip(row, momenta)) - row.target + row.softness * old.normal
    new = positive(old.normal - row.normal_mass * wanted, row.normal_mass * row.width)
    give(row, momenta, Impulse(new - old.normal, ca.SX.zeros(3), ca.SX(0), ca.SX.zeros(3)))
    return new


def _tangent(row: ContactRow, momenta: Momenta, old: Impulse, normal: Expr) -> Expr:
    """The friction impulse, onto the disc of radius mu ln."""
    slip = _slip(row, momenta) - row.slip_target
    wanted = old.tangent - row.tangent_mass * _across(slip, row.normal)
    new = onto_disc(wanted, row.law.friction * normal, row.tangent_mass * row.knob, row.knob)
    give(row, momenta, Impulse(ca.SX(0), new - old.tangent, ca.SX(0), ca.SX.zeros(3)))
    return new


def _torques(row: ContactRow, momenta: Momenta, old: Impulse, normal: Expr) -> tuple[Expr, Expr]:
    """Torsional friction (an interval) and rolling friction (a disc), both limited by the normal impulse."""
    if not row.law.spins:
        return old.spin, old.roll
    n = row.normal
    spin_width, roll_width = row.knob * row.spin_mass, row.knob * row.roll_mass
    rate = sum(side.sign * _spin(momenta, side) for side in row.sides)
    twist = n * (old.spin - row.spin_mass * ca.dot(n, rate))
    spin = ca.dot(n, onto_disc(twist, row.law.torsion * normal, spin_width, row.knob))
    wanted = old.roll - row.roll_mass * _across(rate, n)
    roll = onto_disc(wanted, row.law.rolling * normal, roll_width, row.knob)
    give(row, momenta, Impulse(ca.SX(0), ca.SX.zeros(3), spin - old.spin, roll - old.roll))
    return spin, roll


def _across(a: Expr, n: Expr) -> Expr:
    return a - n * ca.dot(n, a)


def _spin(momenta: Momenta, side: Side) -> Expr:
    return apply(side.inverse_inertia, momenta.angular[side.body])


def _slip(row: ContactRow, momenta: Momenta) -> Expr:
    """(3,) [m/s]: relative velocity of the touching points."""
    total = ca.SX.zeros(3)
    for side in row.sides:
        total += side.sign * (momenta.velocity[side.body] + ca.cross(_spin(momenta, side), side.arm))
    return total
