"""From velocities to displacements: impacts act from their instant on, then a pass removes what still overlaps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.collide.contact import Shift
from symphys.motion import Motion, apply
from symphys.step.pgs import Impulse, Momenta
from symphys.step.row import ContactRow
from symphys.world import Scheme

Expr = Any
"""casadi SX, MX or DM"""


def displacements(
    rows: Sequence[ContactRow],
    impulses: Sequence[Impulse],
    momenta: Momenta,
    motions: Sequence[Motion],
    scheme: Scheme,
    duration: Expr,
) -> dict[int, Shift]:
    """Duration times the new velocities, less t* times what each impact changed: until t* it had not happened."""
    linear = [duration * v for v in momenta.velocity]
    angular = [duration * apply(m.inverse_mid, momentum) for m, momentum in zip(motions, momenta.angular, strict=True)]
    for row, impulse in zip(rows, impulses, strict=True):
        if not scheme.time_of_impact:
            continue
        late = row.contact.hit * row.contact.time
        force, twist = impulse.linear(row.impulse_normal), impulse.angular(row.impulse_normal)
        for side in row.sides:
            torque = ca.cross(side.impulse_arm, force) + twist
            linear[side.body] -= late * side.sign * side.inverse_mass * force
            angular[side.body] -= late * side.sign * apply(motions[side.body].inverse_mid, torque)
    return {i: Shift(a, b) for i, (a, b) in enumerate(zip(linear, angular, strict=True))}


def push_apart(rows: Sequence[ContactRow], shifts: dict[int, Shift], scheme: Scheme) -> dict[int, Shift]:
    """Gauss-Seidel on the displacements until no rigid contact overlaps; velocities are not touched."""
    rigid = [row for row in rows if not row.law.soft]
    pushes = [ca.SX(0) for _ in rigid]
    for _ in range(scheme.position_sweeps):
        for k, row in enumerate(rigid):
            gap = row.contact.gap_after(shifts)
            push = _not_negative(pushes[k] - scheme.push_out * gap / row.normal_mass)
            _push(row, shifts, push - pushes[k])
            pushes[k] = push
    return shifts


def _not_negative(x: Expr) -> Expr:
    """max(x, 0) with the slope of x at 0: a body that exactly touches is held by the surface."""
    return ca.if_else(x >= 0, x, 0)


def _push(row: ContactRow, shifts: dict[int, Shift], amount: Expr) -> None:
    step = amount * row.normal
    for side in row.sides:
        shift = shifts[side.body]
        turn = apply(side.inverse_inertia, ca.cross(side.arm, step))
        shifts[side.body] = Shift(shift.linear + side.sign * side.inverse_mass * step, shift.angular + side.sign * turn)
