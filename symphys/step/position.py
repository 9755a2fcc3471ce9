"""From velocities to displacements: impacts act from their instant on, then a pass removes what still overlaps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.collide.contact import UNMOVED, Contact, Shift
from symphys.motion import Motion, apply
from symphys.step.axis import AxisRow
from symphys.step.impulse import Impulse
from symphys.step.lock import LockRow
from symphys.step.momentum import Momenta, Momentum
from symphys.step.pgs import Row
from symphys.step.pieces import Pieces
from symphys.step.row import ContactRow
from symphys.step.scene import Scene

Expr = Any
"""casadi SX, MX or DM"""

Shifts = tuple[Shift, ...]


def displacements(
    scene: Scene,
    rows: Sequence[Row],
    started: Sequence[Impulse],
    momenta: Momenta,
    given: Sequence[Impulse],
    motions: Sequence[Motion],
    duration: Expr,
) -> list[Shift]:
    """Duration times the new velocities, less what impulses would have done before they act."""
    do = scene.pieces.do
    shifts = [do(_drift, motion, momentum, duration) for motion, momentum in zip(motions, momenta, strict=True)]
    if not scene.setting.scheme.time_of_impact:
        return shifts
    for each, *impulses in zip(rows, started, given, strict=True):
        for side, body in enumerate(each.bodies):
            shifts[body] = do(_delayed, shifts[body], each.row, side, impulses, motions[body].inverse_mid)
    return shifts


def _drift(motion: Motion, momentum: Momentum, duration: Expr) -> Shift:
    return Shift(duration * momentum.velocity, duration * apply(motion.inverse_mid, momentum.angular))


def _delayed(shift: Shift, row: ContactRow, k: int, impulses: list[Impulse], turning: Expr) -> Shift:
    """The displacement less that which the impulse on side k would have caused before it acts.

    What goes on from the last step has acted all the time, whatever rounding makes of the gap.
    """
    side, impulse = row.sides[k], impulses[1].minus(impulses[0].times(row.lasts))
    force, twist = impulse.linear(row.impulse_normal), impulse.angular(row.impulse_normal)
    torque = ca.cross(side.impulse_arm, force) + twist
    early = row.delay * side.sign
    return Shift(shift.linear - early * side.inverse_mass * force, shift.angular - early * apply(turning, torque))


def close_gaps(
    scene: Scene,
    rows: Sequence[Row],
    contacts: Sequence[Contact],
    impulses: Sequence[Impulse],
    locks: Sequence[Row],
    shifts: list[Shift],
) -> tuple[Shifts, Momenta]:
    """Gauss-Seidel on the displacements until joints fit, no rigid contact overlaps, and those that last do not gape.

    Returns:
        The displacements, and what joints did to them as momenta times a time: mass [kg m] and inertia [kg m^2] times
        displacement. Velocities are not touched.
    """
    do, scheme = scene.pieces.do, scene.setting.scheme
    rigid = tuple(
        (each, contact, do(_lasts, each.row, impulse))
        for each, contact, impulse in zip(rows, contacts, impulses, strict=True)
        if not each.row.law.soft
    )
    none = Momentum(ca.SX.zeros(3), ca.SX.zeros(3))
    state = (tuple(shifts), tuple(ca.SX(0) for _ in rigid), tuple(none for _ in shifts))
    context = (tuple(locks), rigid, scheme.push_out)
    shifts_after, _, made = scene.pieces.repeat(scheme.position_sweeps, _push_all, context, state)
    return shifts_after, made


def _lasts(row: ContactRow, impulse: Impulse) -> Expr:
    """1 if a contact carried load and still does."""
    return ca.logic_and(row.lasts, impulse.normal > row.load)


Fitting = LockRow | AxisRow
"""Rows of joints that the pass closes: locks and limits."""
Passing = tuple[Shifts, tuple[Expr, ...], Momenta]
"""Displacements, pushes of contacts, what joints did."""


def _push_all(pieces: Pieces, context: tuple[Any, Any, float], state: Passing) -> Passing:
    """One pass over all joints and rigid contacts."""
    (locks, rigid, share), (shifts, pushes, made) = context, map(list, state)
    for each in locks:
        own = tuple(shifts[i] for i in each.bodies), tuple(made[i] for i in each.bodies)
        for i, shift, momentum in zip(each.bodies, *pieces.do(_fit, each.row, *own), strict=True):
            shifts[i], made[i] = shift, momentum
    for k, (each, contact, lasts) in enumerate(rigid):
        moved = tuple(shifts[i] for i in each.bodies)
        moved, pushes[k] = pieces.do(_push, each.row, contact, lasts, moved, pushes[k], share)
        for i, shift in zip(each.bodies, moved, strict=True):
            shifts[i] = shift
    return tuple(shifts), tuple(pushes), tuple(made)


def _fit(row: Fitting, moved: Shifts, made: Momenta) -> tuple[Shifts, Momenta]:
    """Displacements after which the joint fits, to third order in the rotation: arms are those at the middle."""
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for side, shift in zip(row.sides, moved, strict=True):
        linear += side.sign * (shift.linear + ca.cross(shift.angular, side.arm))
        angular += side.sign * shift.angular
    push, twist = row.given_along.split(row.fitting(row.seen.forwards(linear, angular)))
    fitted, gained = [], []
    for side, shift, m in zip(row.sides, moved, made, strict=True):
        linear, angular = side.sign * push, side.sign * (ca.cross(side.impulse_arm, push) + twist)
        turn = apply(side.inverse_inertia, angular)
        fitted.append(Shift(shift.linear + side.inverse_mass * linear, shift.angular + turn))
        gained.append(Momentum(m.velocity + side.inverse_mass * linear, m.angular + angular))
    return tuple(fitted), tuple(gained) if isinstance(row, LockRow) else made


def _push(
    row: ContactRow, contact: Contact, lasts: Expr, moved: Shifts, old: Expr, share: float
) -> tuple[Shifts, Expr]:
    gap = contact.meeting.gap_after(moved[0], moved[1] if len(moved) > 1 else UNMOVED)
    free = old - share * gap * row.normal_mass
    # at 0 the slope is that of ``free``: a body that exactly touches is held by the surface
    new = ca.if_else(ca.logic_or(lasts, free >= 0), free, 0)
    step = (new - old) * row.normal
    pushed = []
    for side, shift in zip(row.sides, moved, strict=True):
        turn = apply(side.inverse_inertia, ca.cross(side.arm, step))
        pushed.append(Shift(shift.linear + side.sign * side.inverse_mass * step, shift.angular + side.sign * turn))
    return tuple(pushed), new
