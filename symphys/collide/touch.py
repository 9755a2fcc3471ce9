"""The instant at which surfaces touch inside a step, from their gap as a function of time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from symphys.collide.contact import Contact, Meeting
from symphys.smooth import TINY_SQUARE

Expr = Any
"""casadi SX"""

TOUCH = 1e-12
"""[m] gap up to which surfaces count as touching."""
STILL = 1e-6
"""[m/s] approach below which touching surfaces count as resting on each other."""
TINY_RATE = 1e-12
"""[m/s] below which surfaces count as not closing."""
NEWTON_STEPS = 3
"""Corrections of the first estimate of the instant."""
FOUND = 1e-9
"""[m] gap at which an instant counts as one of touch."""


def falls(gap: Expr, rate: Expr) -> Expr:
    """1 where surfaces have yet to meet: apart, or touching at speed; 0 where they rest on each other or overlap.

    From rest a gap g closes after sqrt(2 g / a), with an infinite slope at g = 0, which a body placed exactly on the
    ground would inherit: there the instant of touch is 0 with slope 0. An impact that falls on the boundary of two
    steps keeps its slope 1 / speed, on whichever side of 0 rounding has put the gap.
    """
    return ca.fmax(gap > TOUCH, ca.logic_and(gap >= -TOUCH, rate < -STILL))


def first_root(gap: Expr, rate: Expr, bend: Expr, dt: Expr) -> Expr:
    """The first t in [0, dt] with gap + rate t + bend t^2/2 = 0; 0 when overlapping, dt when there is none."""
    discriminant = ca.fmax(rate * rate - 2 * bend * gap, 0)
    closing = ca.fmax(ca.sqrt(discriminant + TINY_SQUARE) - rate, TINY_RATE)
    return ca.fmin(ca.if_else(falls(gap, rate), 2 * gap, 0) / closing, dt)


def contact_along(
    gap: Callable[[Expr], Expr], dt: Expr, meeting: Meeting, newton_steps: int = NEWTON_STEPS
) -> Contact:
    """The contact of surfaces whose gap [m] at any time t of the step is ``gap(t)``.

    The first root by the parabola that osculates at t = 0, then Newton steps. The gap of convex shapes in uniform
    motion is a convex function of time: from before the root, or from beyond it while the gap still falls, these
    converge without overshooting. Where the parabola leads to beyond the nearest approach they begin at the tangent's
    root instead, which lies before it.
    """
    t = ca.SX.sym("t")
    value = gap(t)
    rate = ca.gradient(value, t)
    both, bend = ca.vertcat(value, rate), ca.gradient(rate, t)
    start, pace, curve = ca.vertsplit(ca.substitute(ca.vertcat(both, bend), t, 0))
    time, straight = first_root(start, pace, curve, dt), start / ca.fmax(-pace, TINY_RATE)
    for _ in range(newton_steps):
        here, slope = ca.vertsplit(ca.substitute(both, t, time))
        better = ca.if_else(slope < 0, time - here / ca.fmin(slope, -TINY_RATE), straight)
        time = ca.fmin(ca.fmax(better, 0), dt)
    time = ca.if_else(falls(start, pace), time, 0)
    here, slope = ca.vertsplit(ca.substitute(both, t, time))
    through = ca.logic_and(ca.logic_and(time > 0, time < dt), ca.logic_and(ca.fabs(here) < FOUND, slope < 0))
    hit = ca.fmax(ca.substitute(value, t, dt) < 0, through)
    return Contact(start, pace, hit, time, meeting)
