"""Joints within a stretch: their trees and rows, what these start from, and what is stored of what they gave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.generalized_coordinates import Chart, body_momenta, make_chart
from symphys.dynamics.context import Scene, State
from symphys.dynamics.joints.coordinate_constraint import AxisRow
from symphys.dynamics.joints.joint_constraints import ROWS, Stretch, along_coordinate, lock_now, lock_row
from symphys.dynamics.joints.joint_frames import sockets_of
from symphys.dynamics.joints.joint_impulse import Along
from symphys.dynamics.joints.locked_directions import LockRow
from symphys.dynamics.momentum import Momenta, Moved, States
from symphys.dynamics.motion import Motion
from symphys.dynamics.pgs import Row
from symphys.dynamics.tracing.decorator import traced
from symphys.model.joints import carriers, linkages, tree_joints
from symphys.model.world import World

Expr = Any
"""casadi SX"""
LIMITS = ("lower", "upper")


@dataclass(frozen=True)
class Trees:
    """The trees of a world over a stretch.

    Attributes:
        charts: in the order of ``linkages``.
        motions: of all bodies, those of trees with how they are held.
        states: what the sweeps start from, without any impulse of the stretch.
        carriers: for each body where the sweeps keep what they know of it.
    """

    charts: tuple[Chart, ...]
    motions: tuple[Motion, ...]
    states: States
    carriers: tuple[int, ...]

    def row(self, bodies: tuple[int, ...], row: Any) -> Row:
        """A row on these bodies."""
        return Row(bodies, row, tuple(self.carriers[i] for i in bodies))

    def same(self, bodies: tuple[int, ...]) -> bool:
        """Whether both are of one tree."""
        return len(bodies) == 2 and self.carriers[bodies[0]] == self.carriers[bodies[1]]


def make_trees(scene: Scene, motions: Sequence[Motion], free: Momenta, middle: Expr) -> Trees:
    """The trees; ``free``: momenta of all bodies without any impulse of the stretch."""
    joints, held = scene.world.joints, list(motions)
    states: list[Moved] = list(free)
    charts, touched = [], _touched(scene.world)
    for tree in linkages(joints):
        own = tuple(None if link.joint is None else joints[link.joint] for link in tree.links)
        reached = tuple(body in touched for body in tree.bodies)
        parts = tuple(motions[i] for i in tree.bodies), tuple(free[i] for i in tree.bodies)
        chart = make_chart(tree, own, reached, *parts, middle)
        charts.append(chart)
        for body, holds in zip(tree.bodies, chart.held, strict=True):
            held[body], states[body] = replace(motions[body], held=holds), None
        states[tree.root] = chart.free
    return Trees(tuple(charts), tuple(held), tuple(states), carriers(len(motions), joints))


def _touched(world: World) -> set[int]:
    """Bodies on which contacts act, or joints that close loops or give way."""
    exact = tree_joints(world.joints)
    sides = {side.body for pair in world.pairs for side in (pair.first, pair.second)}
    loose = {body for k, joint in enumerate(world.joints) if k not in exact for body in joint.bodies}
    return {body for body in sides if body is not None} | loose


def momenta_of(scene: Scene, trees: Trees, solved: States) -> Momenta:
    """Of all bodies."""
    found = list(solved)
    for tree, chart in zip(linkages(scene.world.joints), trees.charts, strict=True):
        momenta = body_momenta(chart, solved[tree.root])
        for body, momentum in zip(tree.bodies, momenta, strict=True):
            found[body] = momentum
    return tuple(found)  # type: ignore[arg-type]


@dataclass(frozen=True)
class JointRow:
    """A row of a joint.

    Attributes:
        row: what sweeps, or the position pass, visit.
        name, k: where the state keeps what it gave: component ``k`` of ``name``, all of it if None.
    """

    row: Row
    name: str
    k: int | None = None


def joint_rows(
    scene: Scene, trees: Trees, paths: Sequence[Motion], duration: Expr, kick: Expr
) -> tuple[list[JointRow], list[Row]]:
    """(what the sweeps visit, what the position pass closes) of all joints over a stretch."""
    setting, stretch = scene.setting, Stretch(duration, kick)
    visited, fitted = list[JointRow](), list[Row]()
    places = _places(scene.world, trees)
    for index, joint in enumerate(scene.world.joints):
        moving = tuple(trees.motions[i] for i in joint.bodies)
        bare = tuple(paths[i] for i in joint.bodies)
        sockets, same = sockets_of(joint, bare), trees.same(joint.bodies)
        if index not in places:
            lock = trees.row(joint.bodies, lock_row(setting, sockets, moving, stretch, same))
            visited.append(JointRow(lock, f"{joint.name}.lock"))
            fitted += [] if joint.soft else [lock]
        for k in range(len(joint.kind.coordinates)) if joint.acting else ():
            states = tuple(trees.states[trees.carriers[i]] for i in joint.bodies)
            at = along_coordinate(sockets, k, moving, states, duration, places.get(index, same))
            command = scene.given(f"{joint.name}.command")
            command = ca.SX(0) if command is None else command[k]
            for part in joint.acting:
                row = trees.row(joint.bodies, ROWS[part](setting, joint, at, command, stretch))
                visited.append(JointRow(row, f"{joint.name}.{part}", k))
                fitted += [row] if part in LIMITS else []
    return visited, fitted


def _places(world: World, trees: Trees) -> dict[int, tuple[int, Expr]]:
    """Of each joint of a tree: its first coordinate, and the tree's gains."""
    return {
        link.joint: (link.start, chart.gains)
        for tree, chart in zip(linkages(world.joints), trees.charts, strict=True)
        for link in tree.links
        if link.joint is not None
    }


def locks_at(scene: Scene, trees: Trees) -> list[tuple[Row, Along]]:
    """The rows of joints that close loops or give way, at an instant at which velocities change; and no impulse."""
    found, exact = [], tree_joints(scene.world.joints)
    for index, joint in enumerate(scene.world.joints):
        if index in exact:
            continue
        moving = tuple(trees.motions[i] for i in joint.bodies)
        states = tuple(trees.states[trees.carriers[i]] for i in joint.bodies)
        sockets = sockets_of(joint, moving)
        row = lock_now(sockets, moving, states, trees.same(joint.bodies))
        found.append((trees.row(joint.bodies, row), Along(ca.SX(joint.locked, 1))))
    return found


def resumed(scene: Scene, rows: Sequence[JointRow], x: State, kick: Expr) -> list[Along]:
    """What the sweeps start from: the last step's forces over this stretch's kick."""
    if not scene.setting.scheme.warm_start:
        return [Along(ca.SX(numbers_of(each.row.row), 1)) for each in rows]
    return [_again(each.row.row, x[each.name], each.k, kick) for each in rows]


def numbers_of(row: LockRow | AxisRow) -> int:
    """How many impulses a row gives."""
    return row.error.leaf.rows if isinstance(row, LockRow) else 1


def own(stored: Expr, k: int | None) -> Expr:
    """What is a row's of a stored column."""
    return stored if k is None else stored[k]


@traced
def _again(row: LockRow | AxisRow, stored: Expr, k: int | None, kick: Expr) -> Along:
    return row.taken_up(kick * own(stored, k))
