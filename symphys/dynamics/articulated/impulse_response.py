"""What impulses along the coordinates of a tree, and on its bodies, do to the numbers that sweeps know of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.branches import Tree, TreeMatrix
from symphys.dynamics.articulated.factorisation import Eliminated
from symphys.dynamics.articulated.schur_complement import Above, Columns, LimbMatrix, dense, paths, solved
from symphys.dynamics.motion import Held
from symphys.dynamics.tracing.decorator import traced
from symphys.maths.rotation import cross_matrix

Expr = Any
"""casadi SX"""
Gain = tuple[Expr, Expr]
"""The rate of a coordinate by the numbers (1, n), and what a unit impulse along it does to them (n,)."""
Numbering = tuple[tuple[int, ...], ...]
"""Which of the n numbers are those of the root, and of each limb."""


@dataclass(frozen=True)
class Placed:
    """A body when velocities are seen: (3,) from the origin of the screws, (3, 3) inertia in the world frame."""

    place: Expr
    inertia: Expr


def numbering(tree: Tree) -> Numbering:
    """The numbers are in the order of the coordinates."""
    return tuple(tree.linkage.links[0].coordinates), *(limb.coordinates for limb in tree.limbs)


def spread(places: Numbering, parts: Sequence[Expr], n: int | None = None) -> Expr:
    """(n, k): rows of parts at their places among all numbers, zeros left out; n None: as many as there are places."""
    found = ca.SX(sum(map(len, places)) if n is None else n, parts[0].size2())
    for each, part in zip(places, parts, strict=True):
        for row, i in enumerate(each):
            for column in range(part.size2()):
                if part.has_nz(row, column):
                    found[i, column] = part[row, column]
    return found


def gains_of(tree: Tree, matrix: TreeMatrix, acting: Sequence[bool]) -> tuple[Gain | None, ...]:
    """Of all coordinates; None for those of links along which nothing acts."""
    found, (root, *_), links = dict[int, Gain](), numbering(tree), tree.linkage.links
    for k in root if acting[0] else ():
        found[k] = _root_gain(k, tree.linkage.size, matrix.root)
    for limb, part in zip(tree.limbs, matrix.limbs, strict=True):
        wanted = [on for link, on in zip(limb.of(links), limb.of(acting), strict=True) for _ in link.coordinates]
        for a, k in enumerate(limb.coordinates):
            if wanted[a]:
                given = _limb_gain(a, part, matrix.root)
                places = root, limb.coordinates
                found[k] = _gain(a, tree.linkage.size, places, part.follows, given)
    return tuple(found.get(k) for k in range(tree.linkage.size))


@traced
def _root_gain(k: int, n: int, root: Eliminated) -> Gain:
    row = ca.SX(1, n)
    row[0, k] = 1
    return row, spread(
        (tuple(range(root.pivots.size1())),), (dense(root.solve({k: ca.SX(1)}), root.pivots.size1()),), n
    )


@traced
def _limb_gain(k: int, matrix: LimbMatrix, root: Eliminated) -> tuple[Expr, Expr]:
    """What a unit impulse along coordinate k of a limb does to the numbers of the root and of the limb."""
    z = dense(matrix.block.solve({k: ca.SX(1)}), matrix.follows.size1())
    reaching: Expr = ca.mtimes(matrix.pushes, z)
    return solved(root, -reaching), z


@traced
def _gain(k: int, n: int, places: Numbering, follows: Expr, given: tuple[Expr, Expr]) -> Gain:
    unit = ca.SX(follows.size1(), 1)
    unit[k] = 1
    return spread(places, (follows[k, :].T, unit), n).T, spread(places, given, n)


def held_of(tree: Tree, matrix: TreeMatrix, bodies: Sequence[tuple[Expr, Placed] | None]) -> tuple[Held | None, ...]:
    """How bodies are held: of each link where impulses count (3,) and where velocities are seen; None if not asked."""
    found: list[Held | None] = [None for _ in bodies]
    (root, *_), n, given = numbering(tree), tree.linkage.size, tree.impulses
    if bodies[0] is not None:
        counted, body = bodies[0]
        parts = _root_see(tree.seen[0], body.place), _root_response(matrix.root, given[0], counted)
        found[0] = _held(n, (root,), *parts, body.inertia)
    for limb, part in zip(tree.limbs, matrix.limbs, strict=True):
        for a, k in enumerate(limb.links):
            if (each := bodies[k]) is not None:
                counted, body = each
                see = _limb_see(limb.above, a, part.follows, limb.of(tree.seen), tree.seen[0], body.place)
                response = _limb_response(limb.above, a, part, matrix.root, limb.of(given), given[0], counted)
                found[k] = _held(n, (root, limb.coordinates), see, response, body.inertia)
    return tuple(found)


@traced
def _held(n: int, places: Numbering, see: Columns, response: Columns, inertia: Expr) -> Held:
    """From (6, k) of the root's and the limb's numbers, and from (k, 6), at their places."""
    numbers = spread(places, response, n)
    return Held(spread(places, [part.T for part in see], n).T, inertia, numbers[:, :3], numbers[:, 3:])


@traced
def _root_see(axes: Expr, place: Expr) -> Columns:
    return (_at_place(axes, place),)


@traced
def _limb_see(above: Above, link: int, follows: Expr, axes: Columns, root: Expr, place: Expr) -> Columns:
    path, own = paths(above, axes)[link], _side_by_side(axes)
    columns = ca.SX(6, own.size2())
    columns[:, path] = own[:, path]
    return _at_place(root + ca.mtimes(own[:, path], follows[path, :]), place), _at_place(columns, place)


def _at_place(columns: Expr, place: Expr) -> Expr:
    """(6, k) screws as velocity at a place above angular velocity."""
    return ca.vertcat(columns[3:, :] - ca.mtimes(cross_matrix(place), columns[:3, :]), columns[:3, :])


@traced
def _root_response(root: Eliminated, axes: Expr, place: Expr) -> Columns:
    right: Expr = ca.mtimes(axes.T, _unit_impulses(place))
    return (ca.horzcat(*(solved(root, right[:, k]) for k in range(6))),)


@traced
def _limb_response(
    above: Above, link: int, matrix: LimbMatrix, root: Eliminated, axes: Columns, root_axes: Expr, place: Expr
) -> Columns:
    """(m, 6), (n, 6): of the numbers of the root and of the limb."""
    impulses, own = _unit_impulses(place), _side_by_side(axes)
    path, n = paths(above, axes)[link], own.size2()
    z = [dense(matrix.block.solve({k: ca.dot(own[:, k], impulses[:, i]) for k in path}), n) for i in range(6)]
    reaching = [ca.mtimes(root_axes.T, impulses[:, i]) - ca.mtimes(matrix.pushes, z[i]) for i in range(6)]
    return ca.horzcat(*(solved(root, each) for each in reaching)), ca.horzcat(*z)


def _side_by_side(axes: Columns) -> Expr:
    return ca.horzcat(*axes)


def _unit_impulses(place: Expr) -> Expr:
    """(6, 6): about the origin, of unit impulses at a place and of unit torque impulses."""
    unit = ca.SX.eye(3)
    return ca.vertcat(ca.horzcat(cross_matrix(place), unit), ca.horzcat(unit, ca.SX(3, 3)))
