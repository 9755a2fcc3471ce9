"""From velocities to displacements: impacts act from their instant on, then a pass removes what still overlaps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.collide.contact import UNMOVED, Contact, Shift
from symphys.motion import Motion, apply
from symphys.step.pgs import Impulse, Momentum, Row, Solution
from symphys.step.pieces import Pieces
from symphys.step.row import ContactRow
from symphys.step.scene import Scene

Expr = Any
"""casadi SX, MX or DM"""

Shifts = tuple[Shift, ...]


def displacements(
    scene: Scene,
    rows: Sequence[Row],
    contacts: Sequence[Contact],
    solved: Solution,
    motions: Sequence[Motion],
    duration: Expr,
) -> list[Shift]:
    """Duration times the new velocities, less t* times what each impact changed: until t* it had not happened."""
    do = scene.pieces.do
    shifts = [do(_drift, motion, momentum, duration) for motion, momentum in zip(motions, solved.momenta, strict=True)]
    if not scene.setting.scheme.time_of_impact:
        return shifts
    for each, contact, impulse in zip(rows, contacts, solved.impulses, strict=True):
        late = contact.hit, contact.time
        for side, body in enumerate(each.bodies):
            turning = motions[body].inverse_mid
            shifts[body] = do(_delayed, shifts[body], each.row, side, impulse, late, turning)
    return shifts


def _drift(motion: Motion, momentum: Momentum, duration: Expr) -> Shift:
    return Shift(duration * momentum.velocity, duration * apply(motion.inverse_mid, momentum.angular))


def _delayed(shift: Shift, row: ContactRow, k: int, impulse: Impulse, late: tuple[Expr, Expr], turning: Expr) -> Shift:
    """The displacement less that which the impulse on side k would have caused before the touch."""
    side, (hit, time) = row.sides[k], late
    force, twist = impulse.linear(row.impulse_normal), impulse.angular(row.impulse_normal)
    torque = ca.cross(side.impulse_arm, force) + twist
    early = hit * time * side.sign
    return Shift(shift.linear - early * side.inverse_mass * force, shift.angular - early * apply(turning, torque))


def push_apart(scene: Scene, rows: Sequence[Row], contacts: Sequence[Contact], shifts: list[Shift]) -> Shifts:
    """Gauss-Seidel on the displacements until no rigid contact overlaps; velocities are not touched."""
    rigid = tuple((each, contact) for each, contact in zip(rows, contacts, strict=True) if not each.row.law.soft)
    state = (tuple(shifts), tuple(ca.SX(0) for _ in rigid))
    scheme = scene.setting.scheme
    context = (rigid, scheme.push_out)
    return scene.pieces.repeat(scheme.position_sweeps, _push_all, context, state)[0]


def _push_all(
    pieces: Pieces, context: tuple[Any, Expr], state: tuple[Shifts, tuple[Expr, ...]]
) -> tuple[Shifts, tuple[Expr, ...]]:
    """One pass over all rigid contacts."""
    (rigid, share), shifts, pushes = context, list(state[0]), list(state[1])
    for k, (each, contact) in enumerate(rigid):
        moved = tuple(shifts[i] for i in each.bodies)
        moved, pushes[k] = pieces.do(_push, each.row, contact, moved, pushes[k], share)
        for i, shift in zip(each.bodies, moved, strict=True):
            shifts[i] = shift
    return tuple(shifts), tuple(pushes)


def _push(row: ContactRow, contact: Contact, moved: Shifts, old: Expr, share: Expr) -> tuple[Shifts, Expr]:
    gap = contact.meeting.gap_after(moved[0], moved[1] if len(moved) > 1 else UNMOVED)
    new = _not_negative(old - share * gap * row.normal_mass)
    step = (new - old) * row.normal
    pushed = []
    for side, shift in zip(row.sides, moved, strict=True):
        turn = apply(side.inverse_inertia, ca.cross(side.arm, step))
        pushed.append(Shift(shift.linear + side.sign * side.inverse_mass * step, shift.angular + side.sign * turn))
    return tuple(pushed), new


def _not_negative(x: Expr) -> Expr:
    """max(x, 0) with the slope of x at 0: a body that exactly touches is held by the surface."""
    return ca.if_else(x >= 0, x, 0)
