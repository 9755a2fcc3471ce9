"""From velocities to displacements: impacts act from their instant on, then a pass removes what still overlaps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.collide.contact import Shift
from symphys.motion import Motion, apply
from symphys.step.pgs import Impulse, Momenta
from symphys.step.row import ContactRow
from symphys.step.scene import Scene

Expr = Any
"""casadi SX, MX or DM"""


def displacements(
    scene: Scene,
    rows: Sequence[ContactRow],
    impulses: Sequence[Impulse],
    momenta: Momenta,
    motions: Sequence[Motion],
    duration: Expr,
) -> dict[int, Shift]:
    """Duration times the new velocities, less t* times what each impact changed: until t* it had not happened."""
    shifts = {
        i: scene.keep(Shift(duration * velocity, duration * apply(motion.inverse_mid, turning)))
        for i, (motion, velocity, turning) in enumerate(zip(motions, momenta.velocity, momenta.angular, strict=True))
    }
    if not scene.scheme.time_of_impact:
        return shifts
    for row, impulse in zip(rows, impulses, strict=True):
        late = row.contact.hit * row.contact.time
        force, twist = impulse.linear(row.impulse_normal), impulse.angular(row.impulse_normal)
        for side in row.sides:
            torque = ca.cross(side.impulse_arm, force) + twist
            early = late * side.sign * side.inverse_mass * force
            turned = late * side.sign * apply(motions[side.body].inverse_mid, torque)
            shift = shifts[side.body]
            shifts[side.body] = scene.keep(Shift(shift.linear - early, shift.angular - turned))
    return shifts


def push_apart(scene: Scene, rows: Sequence[ContactRow], shifts: dict[int, Shift]) -> dict[int, Shift]:
    """Gauss-Seidel on the displacements until no rigid contact overlaps; velocities are not touched."""
    rigid = [row for row in rows if not row.law.soft]
    pushes = [ca.SX(0) for _ in rigid]
    for _ in range(scene.scheme.position_sweeps):
        for k, row in enumerate(rigid):
            gap = row.contact.gap_after(shifts)
            push = _not_negative(pushes[k] - scene.scheme.push_out * gap * row.normal_mass)
            _push(row, shifts, push - pushes[k])
            touched = {side.body: shifts[side.body] for side in row.sides}
            pushes[k], touched = scene.keep((push, touched))
            shifts |= touched
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
