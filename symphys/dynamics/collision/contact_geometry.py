"""The record that every pair of shapes returns."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import casadi as ca

from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class Frame:
    """The contact frame of two surfaces at one instant, world frame.

    Attributes:
        normal: (3,) unit vector from the second surface to the first.
        arms: (3,) [m] from each side's centre of mass to the point of contact; of no meaning for a static side.
    """

    normal: Expr
    arms: tuple[Expr, Expr]

    def flipped(self) -> Frame:
        """Return the contact with its sides exchanged."""
        return Frame(-self.normal, (self.arms[1], self.arms[0]))


@dataclass(frozen=True)
class Displacement:
    """A body's displacement over the step: (3,) [m] and rotation vector (3,) [rad], world frame."""

    linear: Expr
    angular: Expr

    def moved(self, point: Expr, arm: Expr) -> Expr:
        """Return a point of the body after it (3,), to first order in the rotation."""
        return point + self.linear + ca.cross(self.angular, arm)


ZERO_DISPLACEMENT = Displacement(ca.SX.zeros(3), ca.SX.zeros(3))
"""The displacement of what is static."""


class ContactGeometry(Protocol):
    """The geometry of a point of two surfaces at any time of the step. Implementations are frozen dataclasses."""

    def frame(self, t: Expr) -> Frame:
        """Return the frame at time t in the step."""
        ...

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Return the gap [m] at the end of the step, given both sides' displacements."""
        ...


@dataclass(frozen=True)
class Contact:
    """A point where two surfaces may touch in this step.

    Attributes:
        gap: [m] at t_k; negative when overlapping.
        rate: d gap / dt at t_k [m/s].
        hit: 1 if the free paths meet within the step, else 0. A hard select at every smoothing: whether an impact
            falls into this step or the next must not change the motion.
        time: [s] of the first touch inside the step, in [0, dt].
        end: gap at the end of the step, on the free paths [m].
        geometry: how it lies at any time.
    """

    gap: Expr
    rate: Expr
    hit: Expr
    time: Expr
    end: Expr
    geometry: ContactGeometry


@dataclass(frozen=True)
class FlippedGeometry:
    """A contact geometry whose sides are exchanged."""

    geometry: ContactGeometry

    def frame(self, t: Expr) -> Frame:
        """Implement ``ContactGeometry.frame``."""
        return self.geometry.frame(t).flipped()

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Implement ``ContactGeometry.gap_after``."""
        return self.geometry.gap_after(second, first)


def flipped(contact: Contact) -> Contact:
    """Return the contact with its sides exchanged."""
    return replace(contact, geometry=FlippedGeometry(contact.geometry))
