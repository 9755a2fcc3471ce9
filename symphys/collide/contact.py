"""The record that every pair of shapes returns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.world import Pair

Expr = Any
"""casadi SX, MX or DM"""


TOUCH = 1e-12
"""[m] gap up to which surfaces count as touching."""
STILL = 1e-6
"""[m/s] approach below which touching surfaces count as resting on each other."""


def falls(gap: Expr, rate: Expr) -> Expr:
    """1 where surfaces have yet to meet: apart, or touching at speed; 0 where they rest on each other or overlap.

    From rest a gap g closes after sqrt(2 g / a), with an infinite slope at g = 0, which a body placed exactly on the
    ground would inherit: there the instant of touch is 0 with slope 0. An impact that falls on the boundary of two
    steps keeps its slope 1 / speed, on whichever side of 0 rounding has put the gap.
    """
    return ca.fmax(gap > TOUCH, ca.logic_and(gap >= -TOUCH, rate < -STILL))


@dataclass(frozen=True)
class Frame:
    """Where two surfaces meet at one instant, world frame.

    Attributes:
        normal: (3,) unit vector from the second surface to the first.
        arms: (3,) [m] from each side's centre of mass to the point of contact; zero for a static side.
    """

    normal: Expr
    arms: tuple[Expr, Expr]


@dataclass(frozen=True)
class Shift:
    """A body's displacement over the step: (3,) [m] and rotation vector (3,) [rad], world frame."""

    linear: Expr
    angular: Expr


@dataclass(frozen=True)
class Contact:
    """A pair of surfaces that may touch in this step.

    Attributes:
        pair: who, under which law.
        gap: [m] at t_k; negative when overlapping.
        rate: d gap / dt at t_k [m/s].
        hit: 1 if the free paths meet within the step, else 0. A hard select at every smoothing: whether an impact
            falls into this step or the next must not change the motion.
        time: [s] of the first touch inside the step, in [0, dt].
        frame: the frame at time t in the step.
        gap_after: the gap [m] at the end of the step, given both sides' displacements (None for a static side).
    """

    pair: Pair
    gap: Expr
    rate: Expr
    hit: Expr
    time: Expr
    frame: Callable[[Expr], Frame]
    gap_after: Callable[[Mapping[int, Shift]], Expr]


def moved(point: Expr, arm: Expr, shift: Shift) -> Expr:
    """(3,): a body's point after its displacement, to first order in the rotation."""
    return point + shift.linear + ca.cross(shift.angular, arm)
