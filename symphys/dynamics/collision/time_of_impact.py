"""The instant at which surfaces touch inside a step, from their gap as a function of time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any, Protocol

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact, ContactGeometry
from symphys.maths.smoothing import TINY_SQUARE
from symphys.types import Expr

MAX_TOUCH_GAP = 1e-12
"""[m] gap up to which surfaces count as touching."""
MAX_REST_SPEED = 1e-6
"""[m/s] approach below which touching surfaces count as resting on each other."""
MIN_CLOSING_SPEED = 1e-12
"""[m/s] below which surfaces count as not closing."""
NEWTON_STEPS = 3
"""Corrections of the first estimate of the instant."""
MAX_ROOT_GAP = 1e-9
"""[m] gap at which an instant counts as one of touch."""
END_TOLERANCE = 1e-9
"""Share of dt by which an instant may exceed the end of a step and keep its slope: rounding may have put it there."""


def approaches(gap: Expr, rate: Expr) -> Expr:
    """Return 1 where surfaces have yet to meet: apart, or touching at speed; 0 where they rest or overlap.

    From rest a gap g closes after sqrt(2 g / a), with an infinite slope at g = 0, which a body placed exactly on the
    ground would inherit: there the instant of touch is 0 with slope 0. An impact that falls on the boundary of two
    steps keeps its slope 1 / speed, on whichever side of 0 rounding has put the gap.
    """
    return ca.fmax(gap > MAX_TOUCH_GAP, ca.logic_and(gap >= -MAX_TOUCH_GAP, rate < -MAX_REST_SPEED))


def first_root(gap: Expr, rate: Expr, bend: Expr, dt: Expr) -> Expr:
    """Return the first t in [0, dt] with gap + rate t + bend t^2/2 = 0; 0 when overlapping, dt when there is none."""
    discriminant = ca.fmax(rate * rate - 2 * bend * gap, 0)
    closing = ca.fmax(ca.sqrt(discriminant + TINY_SQUARE) - rate, MIN_CLOSING_SPEED)
    return clip_to_end(ca.if_else(approaches(gap, rate), 2 * gap, 0) / closing, dt)


def clip_to_end(t: Expr, dt: Expr) -> Expr:
    """Return min(t, dt) with the slope of t where rounding decides: an impact may fall exactly on the end of a step."""
    return ca.if_else(t > (1 + END_TOLERANCE) * dt, dt, t)


def clip_to_step(t: Expr, dt: Expr) -> Expr:
    """Return the instant t held in [0, dt], with the slope of t at both ends; see ``clip_to_end``."""
    return clip_to_end(ca.if_else(t < -END_TOLERANCE * dt, 0, t), dt)


class Timed(ContactGeometry, Protocol):
    """A contact geometry with a gap at any time."""

    def gap(self, t: Expr) -> Expr:
        """Return the gap [m] at time t in the step."""
        ...


def contact_along(geometry: Timed, dt: Expr, newton_steps: int = NEWTON_STEPS) -> Contact:
    """Return the contact of surfaces whose gap is a function of time.

    The first root by the parabola that osculates at t = 0, then Newton steps. The gap of convex shapes in uniform
    motion is a convex function of time: from before the root, or from beyond it while the gap still falls, these
    converge without overshooting. Where the parabola leads to beyond the nearest approach they begin at the tangent's
    root instead, which lies before it.
    """
    at = gap_rate_bend(geometry)
    start, pace, curve = at(ca.SX(0))
    time, straight = first_root(start, pace, curve, dt), start / ca.fmax(-pace, MIN_CLOSING_SPEED)
    for _ in range(newton_steps):
        here, slope, _ = at(time)
        better = ca.if_else(slope < 0, time - here / ca.fmin(slope, -MIN_CLOSING_SPEED), straight)
        time = clip_to_step(better, dt)
    time = ca.if_else(approaches(start, pace), time, 0)
    here, slope, _ = at(time)
    through = ca.logic_and(ca.logic_and(time > 0, time < dt), ca.logic_and(ca.fabs(here) < MAX_ROOT_GAP, slope < 0))
    end = at(dt)[0]
    return Contact(start, pace, ca.fmax(end < 0, through), time, end, geometry)


def gap_rate_bend(geometry: Timed) -> Callable[[Expr], list[Expr]]:
    """Return the gap and its two derivatives at a time.

    They are worked out with symbols in place of the expressions that the geometry is made of: casadi would otherwise
    look through all that these depend on, each time.
    """
    t, symbols, values = ca.SX.sym("t"), list[Expr](), list[Expr]()
    gap = on_symbols(geometry, symbols, values).gap(t)
    rate = ca.gradient(gap, t)
    function = ca.Function("gap", [t, *symbols], [gap, rate, ca.gradient(rate, t)])
    return lambda time: list(function.call([time, *values]))


def on_symbols(tree: Any, symbols: list[Expr], values: list[Expr]) -> Any:
    """Return a tree of dataclasses and tuples with a symbol for each of its numbers, but for constants.

    They are appended.
    """
    if isinstance(tree, ca.SX):
        numbers: list[Expr] = tree.nonzeros()
        found = [number for number in numbers if not number.is_constant()]
        symbols.append(ca.SX.sym("part", len(found)))
        values.append(ca.vertcat(ca.SX(0, 1), *found))
        fresh: Iterator[Expr] = iter(symbols[-1].nonzeros())
        entries = [n if n.is_constant() else next(fresh) for n in numbers]
        return ca.SX(tree.sparsity(), ca.vertcat(ca.SX(0, 1), *entries))
    if isinstance(tree, tuple):
        return tuple(on_symbols(part, symbols, values) for part in tree)
    if is_dataclass(tree) and not isinstance(tree, type):
        parts = {each.name: on_symbols(getattr(tree, each.name), symbols, values) for each in fields(tree)}
        return replace(tree, **parts)
    return tree
