"""Joints within a stretch: their rows, what these start from, and what is stored of what they gave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.joints import Joint
from symphys.motion import Motion
from symphys.step.along import Along
from symphys.step.axis import AxisRow
from symphys.step.joint_rows import ROWS, Stretch, along_coordinate, lock_now, lock_row
from symphys.step.lock import LockRow, in_world
from symphys.step.momentum import Momenta, Momentum
from symphys.step.pgs import Row
from symphys.step.row import ContactRow
from symphys.step.scene import Scene, State
from symphys.step.sockets import free, locked, sockets_at, sockets_of
from symphys.world import World

Expr = Any
"""casadi SX"""
LIMITS = ("lower", "upper")
Struck = Mapping[frozenset[int], Expr]
"""Of bodies that hang together: 1 if one of their contacts is an impact."""
Total = list[tuple[Expr, Expr]]
"""Force and torque on each body."""


@dataclass(frozen=True)
class JointRow:
    """A row of a joint.

    Attributes:
        row: what sweeps visit.
        name, k: where the state keeps what it gave: component ``k`` of ``name``, all of it if None.
        fits: whether the position pass closes it: limits, and what a joint locks that does not give way.
    """

    row: Row
    name: str
    k: int | None = None
    fits: bool = False


def joint_rows(scene: Scene, motions: Sequence[Motion], momenta: Momenta, duration: Expr, kick: Expr) -> list[JointRow]:
    """The rows of all joints over a stretch; ``momenta`` without any impulse of it."""
    do, setting, rows = scene.pieces.do, scene.setting, []
    stretch = Stretch(duration, kick)
    for joint in scene.world.joints:
        moving, own = tuple(motions[i] for i in joint.bodies), tuple(momenta[i] for i in joint.bodies)
        sockets = do(sockets_of, joint, moving)
        lock = Row(joint.bodies, do(lock_row, setting, sockets, moving, stretch))
        rows.append(JointRow(lock, f"{joint.name}.lock", fits=not joint.soft))
        for k, coordinate in enumerate(joint.kind.coordinates if joint.acting else ()):
            at = do(along_coordinate, sockets, coordinate, moving, own, duration)
            command = scene.given(f"{joint.name}.command")
            command = ca.SX(0) if command is None else command[k]
            for part in joint.acting:
                row = Row(joint.bodies, do(ROWS[part], setting, joint, at, command, stretch))
                rows.append(JointRow(row, f"{joint.name}.{part}", k, fits=part in LIMITS))
    return rows


@dataclass(frozen=True)
class AtOnce:
    """A lock at an instant, and no impulse of it."""

    row: Row
    nothing: Along


def locks_at(scene: Scene, motions: Sequence[Motion], momenta: Momenta) -> list[AtOnce]:
    """The rows of all joints at an instant at which velocities change: what they lock keeps its velocity."""
    found = []
    for joint in scene.world.joints:
        moving, own = tuple(motions[i] for i in joint.bodies), tuple(momenta[i] for i in joint.bodies)
        sockets = scene.pieces.do(sockets_of, joint, moving)
        row = scene.pieces.do(lock_now, sockets, moving, own)
        found.append(AtOnce(Row(joint.bodies, row), Along(ca.SX(joint.locked, 1))))
    return found


def resumed(scene: Scene, rows: Sequence[JointRow], x: State, kick: Expr) -> list[Along]:
    """What the sweeps start from: the last step's forces over this stretch's kick."""
    if not scene.setting.scheme.warm_start:
        return [Along(ca.SX(numbers_of(each.row.row), 1)) for each in rows]
    return [scene.pieces.do(_again, each.row.row, column(x, each), kick) for each in rows]


def numbers_of(row: LockRow | AxisRow) -> int:
    """How many impulses a row gives."""
    return row.error.leaf.rows if isinstance(row, LockRow) else 1


def column(x: State, each: JointRow) -> Expr:
    """What the state holds of a row."""
    return x[each.name] if each.k is None else x[each.name][each.k]


def _again(row: LockRow | AxisRow, force: Expr, kick: Expr) -> Along:
    return row.taken_up(kick * force)


def components(world: World) -> list[frozenset[int]]:
    """The bodies that hang together by joints."""
    found = [frozenset((i,)) for i in range(len(world.bodies))]
    for joint in world.joints:
        touched = [group for group in found if group & set(joint.bodies)]
        found = [group for group in found if group not in touched] + [frozenset().union(*touched)]
    return found


def struck_by_component(
    scene: Scene, contacts: Sequence[Row], joints: Sequence[JointRow], given: Sequence[Along]
) -> Struck:
    """Of each component: 1 if a contact or a limit of it is an impact, whose share of joint forces does not last."""
    found = {}
    for group in components(scene.world):
        meeting = tuple(each.row for each in contacts if group & set(each.bodies))
        limits = tuple(
            (each.row.row, impulse)
            for each, impulse in zip(joints, given, strict=True)
            if group & set(each.row.bodies) and each.name.rpartition(".")[2] in LIMITS
        )
        found[group] = scene.pieces.do(_any_struck, meeting, limits)
    return found


def _any_struck(rows: tuple[ContactRow, ...], limits: tuple[tuple[AxisRow, Along], ...]) -> Expr:
    struck = [ca.fmax(row.struck, row.leaving > 0) for row in rows]
    struck += [ca.logic_and(row.landing, impulse.numbers != 0) for row, impulse in limits]
    return ca.mmax(ca.vertcat(ca.SX(0), *struck))


def store_joint_forces(
    scene: Scene, rows: Sequence[JointRow], given: Sequence[Along], struck: Struck, x: State, kick: Expr
) -> State:
    """Persistent joint forces.

    In a stretch with an impact those of the last one stay: what held the impact is not to be told from them.
    """
    kept = dict[str, list[Expr]]()
    for each, impulse in zip(rows, given, strict=True):
        group = next(g for g in struck if set(each.row.bodies) & g)
        force = scene.pieces.do(
            _lasting, each.row.row, impulse, column(x, each), struck[group], kick, scene.shortest_kick
        )
        kept.setdefault(each.name, []).append(force)
    return {name: scene.pieces.do(_stacked, tuple(parts)) for name, parts in kept.items()}


def _lasting(row: LockRow | AxisRow, impulse: Along, old: Expr, struck: Expr, kick: Expr, shortest: float) -> Expr:
    return ca.if_else(struck, old, row.carried(impulse) / ca.fmax(kick, shortest))


def _stacked(parts: tuple[Expr, ...]) -> Expr:
    return ca.vertcat(*parts)


def keep_up(scene: Scene, momenta: Momenta, made: Momenta, struck: Struck, duration: Expr) -> Momenta:
    """The momenta, with those that the displacements by joints stand for (as SHAKE has it), so that spin is kept.

    Not in a stretch with an impact, where they make up for impulses that act late. They are no part of the forces that
    the next sweeps start from.
    """
    if not scene.world.joints:
        return momenta
    found, dt = list(momenta), scene.setting.scheme.dt
    for i in sorted({i for joint in scene.world.joints for i in joint.bodies}):
        impact = next(impact for group, impact in struck.items() if i in group)
        found[i] = scene.pieces.do(_kept_up, momenta[i], made[i], impact, duration, dt)
    return tuple(found)


def _kept_up(momentum: Momentum, made: Momentum, impact: Expr, duration: Expr, dt: float) -> Momentum:
    share = ca.if_else(impact, 0, duration / dt**2)
    return Momentum(momentum.velocity + share * made.velocity, momentum.angular + share * made.angular)


def hold(scene: Scene, forces: State, poses: Sequence[tuple[Expr, Expr]], total: Total) -> None:
    """Adds to ``total`` what joint forces do to bodies at these poses: those at which the next step begins."""
    for joint in scene.world.joints:
        own = tuple(poses[i] for i in joint.bodies)
        parts = tuple((part, forces[f"{joint.name}.{part}"]) for part in ("lock", *joint.acting))
        for body, wrench in zip(joint.bodies, scene.pieces.do(_wrenches, joint, own, parts), strict=True):
            total[body] = scene.pieces.do(_added, total[body], wrench)


def _wrenches(
    joint: Joint, poses: tuple[tuple[Expr, Expr], ...], parts: tuple[tuple[str, Expr], ...]
) -> tuple[tuple[Expr, Expr], ...]:
    """Force and torque on each moving side."""
    sockets, now = sockets_at(joint, poses), ca.SX(0)
    placed, arms = sockets.placed(now), sockets.common_arms(now)
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for part, numbers in parts:
        along = [locked(joint, placed)] if part == "lock" else [free(c, placed) for c in joint.kind.coordinates]
        if part == "lock" and joint.kind.slides is None:
            numbers = in_world(placed.a, numbers)
        columns = [numbers] if part == "lock" else ca.vertsplit(numbers)
        for directions, values in zip(along, columns, strict=True):
            force, torque = directions.split(values)
            linear, angular = linear + force, angular + torque
    first = linear, ca.cross(arms[0], linear) + angular
    second = -linear, -ca.cross(arms[1], linear) - angular
    return (first, second)[: len(poses)]


def _added(total: tuple[Expr, Expr], wrench: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
    return total[0] + wrench[0], total[1] + wrench[1]
