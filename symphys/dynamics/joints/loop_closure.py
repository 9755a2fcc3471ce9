"""Joints that close loops, and limits of joints that are no tree's, in the position pass: along trees' coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Shift
from symphys.dynamics.contact.constraint import Side
from symphys.dynamics.joints.coordinate_constraint import AxisRow
from symphys.dynamics.joints.locked_directions import LockRow
from symphys.dynamics.momentum import Rates
from symphys.dynamics.motion import Held, Motion, apply
from symphys.dynamics.pgs import Row
from symphys.dynamics.tracing.decorator import repeat, traced

Expr = Any
"""casadi SX"""
Shifts = tuple[Shift, ...]
Displaced = Shift | Rates | None
"""Of a body; of a tree along its coordinates, at its root; None for other bodies of a tree."""
Fitted = tuple[tuple[Displaced, ...], tuple[Rates | None, ...]]
"""Displacements, and of each tree with loops what their locks did to them."""


@dataclass(frozen=True)
class Fitting:
    """What stays the same over the sweeps of the pass."""

    motions: tuple[Motion, ...]
    rows: tuple[Row, ...]


def close_loops(sweeps: int, motions: tuple[Motion, ...], rows: tuple[Row, ...], along: Sequence[Displaced]) -> Fitted:
    """Gauss-Seidel on displacements, over rows of locks and limits."""
    looped = {each.carriers[0] for each in rows if isinstance(each.row, LockRow)}
    still = tuple(_still(each) if i in looped else None for i, each in enumerate(along))
    return repeat(sweeps, _fit_all, Fitting(motions, rows), (tuple(along), still))


@traced
def _still(along: Displaced) -> Rates:
    assert isinstance(along, Rates)
    return Rates(ca.SX(along.numbers.size1(), 1))


@traced
def displaced(held: Held | None, along: Displaced) -> Shift:
    """A body's displacement."""
    if held is not None and isinstance(along, Rates):
        more = apply(held.see, along.numbers)
        return Shift(more[:3], more[3:])
    assert isinstance(along, Shift)
    return along


def _fit_all(context: Fitting, state: Fitted) -> Fitted:
    """One pass over all rows."""
    along, made = list(state[0]), list(state[1])
    for each in context.rows:
        before = tuple(along[i] for i in each.carriers)
        parts = zip(each.bodies, before, strict=True)
        moved = tuple(displaced(context.motions[i].held, own) for i, own in parts)
        after = _fit(each.row, moved, before)
        for i, own in zip(each.carriers, after, strict=True):
            along[i] = own
        root = each.carriers[0]
        if isinstance(each.row, LockRow):
            made[root] = _more(made[root], before[0], after[0])
    return tuple(along), tuple(made)


@traced
def _fit(row: LockRow | AxisRow, moved: Shifts, along: tuple[Displaced, ...]) -> tuple[Displaced, ...]:
    """Displacements after which the joint fits."""
    push, twist = row.given_along.split(row.fitting(_relative(row, moved)))
    if row.same:
        after = along[0]
        for side in row.sides:
            after = _pushed(side, after, push, twist)
        return tuple(after for _ in row.sides)
    return tuple(_pushed(side, own, push, twist) for side, own in zip(row.sides, along, strict=True))


def _pushed(side: Side, along: Displaced, push: Expr, twist: Expr) -> Displaced:
    if isinstance(along, Rates) and side.reach is not None:
        return Rates(along.numbers + side.sign * (apply(side.reach.push, push) + apply(side.reach.twist, twist)))
    assert isinstance(along, Shift)
    turn = apply(side.inverse_inertia, ca.cross(side.impulse_arm, push) + twist)
    return Shift(along.linear + side.sign * side.inverse_mass * push, along.angular + side.sign * turn)


@traced
def _more(made: Rates | None, before: Displaced, after: Displaced) -> Rates:
    assert isinstance(made, Rates) and isinstance(before, Rates) and isinstance(after, Rates)
    return Rates(made.numbers + after.numbers - before.numbers)


def _relative(row: LockRow | AxisRow, moved: Shifts) -> Expr:
    """Of the first side against the second along the row's directions, to third order in the rotation."""
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for side, shift in zip(row.sides, moved, strict=True):
        linear += side.sign * (shift.linear + ca.cross(shift.angular, side.arm))
        angular += side.sign * shift.angular
    return row.seen.forwards(linear, angular)
