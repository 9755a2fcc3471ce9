"""The velocities of a tree of bodies in the coordinates that its joints leave, and what impulses do to them.

Velocities are seen at the middle of a stretch and impulses given at its start, as rows of joints are (``joint_rows``):
a body's velocity is ``see`` times the rates of the coordinates, with arms at the middle; impulses of locks, which act
at the start on one point of both sides, do nothing along the free motions of the start. So
sum of free_motion . (momentum - free momentum) = sum of free_motion . impulses,  free motions being those of the start,
holds whatever the locks give: joints are held exactly, and the sweeps know contacts, motors and limits only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.course import Course
from symphys.joints import Joint, Linkage, Placed
from symphys.motion import Held, Motion
from symphys.step.elimination import Eliminated
from symphys.step.momentum import Momentum, Rates
from symphys.step.sockets import sockets_on

Expr = Any
"""casadi SX"""
Columns = dict[int, tuple[Expr, Expr]]
"""By coordinate: velocity (3,) and angular velocity (3,) of a body for a unit rate."""


@dataclass(frozen=True)
class Chart:
    """A tree over a stretch.

    Attributes:
        free: rates of the coordinates without any impulse of the stretch.
        held: of each link: how its body moves with the rates, and what impulses on it do to them.
        gains: (n, n) column k: what a unit impulse along coordinate k does to the rates.
    """

    free: Rates
    held: tuple[Held, ...]
    gains: Expr


def make_chart(
    linkage: Linkage,
    joints: Sequence[Joint | None],
    reached: Sequence[bool],
    motions: Sequence[Motion],
    free: Sequence[Momentum],
    middle: Expr,
) -> Chart:
    """The chart of a tree.

    Args:
        linkage: the tree.
        joints: of its links, as are the other sequences.
        reached: whether anything but the tree's own joints acts on the body.
        motions: what the bodies do.
        free: their momenta without any impulse of the stretch.
        middle: when velocities are seen [s].
    """
    seen, given = (columns_of(linkage, joints, motions, t, common) for t, common in ((middle, False), (ca.SX(0), True)))
    inertias = [_inertia(motion, middle) for motion in motions]
    matrix = Eliminated(mass_matrix(linkage, seen, given, [m.mass for m in motions], inertias))
    right: dict[int, Expr] = {}
    for columns, momentum, motion in zip(given, free, motions, strict=True):
        for k, (velocity, spin) in columns.items():
            push = motion.mass * ca.dot(velocity, momentum.velocity) + ca.dot(spin, momentum.angular)
            right[k] = right.get(k, 0) + push
    n = linkage.size
    held = tuple(
        Held(_matrix(s, n), inertia, *(_responses(matrix, g, n) if acts else 2 * (ca.SX(n, 3),)))
        for s, g, inertia, acts in zip(seen, given, inertias, reached, strict=True)
    )
    gains = ca.horzcat(*(dense(matrix.solve({k: ca.SX(1)}), n) for k in range(n)))
    return Chart(Rates(dense(matrix.solve(right), n)), held, gains)


def _inertia(motion: Motion, t: Expr) -> Expr:
    """(3, 3), world frame: the inverse of what rows take for the inverse."""
    inverse = motion.inverse_inertia(t)
    return ca.SX.eye(3) / inverse if ca.SX(inverse).is_scalar() else ca.inv_minor(inverse)


def columns_of(
    linkage: Linkage, joints: Sequence[Joint | None], courses: Sequence[Course], t: Expr, common: bool
) -> list[Columns]:
    """Of each link: how its body moves with each coordinate, with arms at time t, or to the common points."""
    place = {link.body: k for k, link in enumerate(linkage.links)}
    found: list[Columns] = []
    for link, joint, course in zip(linkage.links, joints, courses, strict=True):
        if joint is None:
            found.append(_floating())
            continue
        above = () if link.parent is None else (courses[place[link.parent]],)
        sockets = sockets_on(joint, (course, *above) if link.sign > 0 else (*above, course))
        arms = sockets.common_arms(t) if common else sockets.lever_arms(t)
        own, other = arms if link.sign > 0 else arms[::-1]
        columns: Columns = {}
        for k, (velocity, spin) in found[place[link.parent]].items() if link.parent is not None else ():
            columns[k] = velocity + ca.cross(spin, other - own), spin
        for k, (slide, turn) in enumerate(free_motions_of(joint, sockets.placed(t))):
            spin = link.sign * turn
            columns[link.start + k] = link.sign * slide - ca.cross(spin, own), spin
        found.append(columns)
    return found


def _floating() -> Columns:
    unit, zero = ca.SX.eye(3), ca.SX.zeros(3)
    return {k: (unit[:, k], zero) if k < 3 else (zero, unit[:, k - 3]) for k in range(6)}


def free_motions_of(joint: Joint, placed: Placed) -> list[tuple[Expr, Expr]]:
    """(displacement, rotation) (3,) each of the first side against the second, that a joint leaves free."""
    zero = ca.SX.zeros(3)
    if joint.kind.coordinates:
        axes = [(c.turns, c.axis(placed)) for c in joint.kind.coordinates]
        return [(zero, axis) if turns else (axis, zero) for turns, axis in axes]
    free = 6 - joint.locked
    return [(zero, ca.SX.eye(3)[:, k]) for k in range(free)]


def mass_matrix(
    linkage: Linkage, seen: list[Columns], given: list[Columns], masses: Sequence[Expr], inertias: Sequence[Expr]
) -> list[dict[int, Expr]]:
    """By rows: the momenta of rates as seen, along the free motions as given; inertias (3, 3) in the world frame."""
    rows: list[dict[int, Expr]] = [{} for _ in range(linkage.size)]
    for see, give, mass, inertia in zip(seen, given, masses, inertias, strict=True):
        momenta = {j: (mass * velocity, ca.mtimes(inertia, spin)) for j, (velocity, spin) in see.items()}
        for i, (velocity, spin) in give.items():
            for j, (push, turn) in momenta.items():
                rows[i][j] = rows[i].get(j, 0) + ca.dot(velocity, push) + ca.dot(spin, turn)
    return rows


def _matrix(columns: Columns, n: int) -> Expr:
    """(6, n): velocity above angular velocity."""
    found = ca.SX(6, n)
    for k, (velocity, spin) in columns.items():
        found[:, k] = ca.vertcat(velocity, spin)
    return ca.sparsify(found)


def _responses(matrix: Eliminated, given: Columns, n: int) -> tuple[Expr, Expr]:
    """(n, 3) each: what unit impulses at the centre of mass, and unit torque impulses, do to the rates."""
    parts = []
    for which in (0, 1):
        units = [{k: column[which][axis] for k, column in given.items()} for axis in range(3)]
        parts.append(
            ca.horzcat(*(dense(matrix.solve({k: v for k, v in u.items() if not v.is_zero()}), n) for u in units))
        )
    return parts[0], parts[1]


def dense(entries: dict[int, Expr], n: int) -> Expr:
    """(n,) of a sparse vector."""
    return ca.vertcat(*(ca.SX(entries.get(k, 0)) for k in range(n)))


def body_momentum(held: Held, mass: Expr, rates: Rates) -> Momentum:
    """Of a body of the tree."""
    moving = ca.mtimes(held.see, rates.numbers)
    return Momentum(moving[:3], ca.mtimes(held.inertia, moving[3:]))
