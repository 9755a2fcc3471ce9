"""A tree's mass matrix limb by limb: what is done with a limb is a piece, so that equal limbs share it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.articulated import schur_complement as limbs
from symphys.dynamics.articulated import spatial as screws
from symphys.dynamics.articulated.factorisation import Eliminated
from symphys.dynamics.articulated.schur_complement import Above, Axes, Columns, Inertia, LimbMatrix, Screw
from symphys.dynamics.collision.predicted_points import Course
from symphys.dynamics.tracing.decorator import traced
from symphys.model.joints import Linkage

Expr = Any
"""casadi SX"""


@dataclass(frozen=True)
class Limb:
    """What hangs on one link that hangs on the root.

    Attributes:
        links: among those of the tree.
        above: see ``limbs``.
        coordinates: among those of the tree.
    """

    links: tuple[int, ...]
    above: Above
    coordinates: tuple[int, ...]

    def of(self, parts: Sequence[Any]) -> tuple[Any, ...]:
        """What is the limb's of something that every link of the tree has."""
        return tuple(parts[k] for k in self.links)


def limbs_of(linkage: Linkage) -> tuple[Limb, ...]:
    """The limbs of a tree."""
    place = {link.body: k for k, link in enumerate(linkage.links)}
    members: list[list[int]] = []
    limb_of: dict[int, list[int]] = {}
    for k, link in enumerate(linkage.links[1:], 1):
        parent = place[link.parent] if link.parent is not None else 0
        if parent == 0:
            members.append([])
        limb_of[k] = limb_of[parent] if parent else members[-1]
        limb_of[k].append(k)
    found = []
    for links in members:
        above = (linkage.links[k].parent for k in links)
        parents = tuple(links.index(place[i]) if i is not None and place[i] else None for i in above)
        own = (range(linkage.links[k].start, linkage.links[k].start + linkage.links[k].count) for k in links)
        found.append(Limb(tuple(links), parents, tuple(j for each in own for j in each)))
    return tuple(found)


@dataclass(frozen=True)
class Tree:
    """A tree at an instant, or between two: its structure, and the screws (6, count) of its links: see ``Axes``."""

    linkage: Linkage
    seen: Columns
    given: Columns | None = None

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """Its limbs."""
        return limbs_of(self.linkage)

    def axes(self, limb: Limb) -> Axes:
        """The screws of a limb and of the root."""
        if self.given is None:
            return Axes(limb.of(self.seen), self.seen[0])
        return Axes(limb.of(self.seen), self.seen[0], limb.of(self.given), self.given[0])

    @property
    def impulses(self) -> Columns:
        """The screws along which impulses count."""
        return self.seen if self.given is None else self.given


@dataclass(frozen=True)
class TreeMatrix:
    """The mass matrix of a tree, factored."""

    limbs: tuple[LimbMatrix, ...]
    root: Eliminated


@dataclass(frozen=True)
class Solved:
    """Rates r of a root, and what limbs do beside following it, z of each."""

    r: Expr
    z: tuple[Expr, ...]


def axes_at(linkage: Linkage, joints: screws.Joints, courses: Sequence[Course], t: Expr, origin: Expr) -> Columns:
    """The screws of all links at time t."""
    place = {link.body: k for k, link in enumerate(linkage.links)}
    found = []
    for link, joint, course in zip(linkage.links, joints, courses, strict=True):
        own = (course,) if link.parent is None else (course, courses[place[link.parent]])
        found.append(screws.axes_of(joint, link.sign, own, t, origin))
    return tuple(found)


def tree_matrix(tree: Tree, inertias: Sequence[Inertia]) -> TreeMatrix:
    """Of a tree, its bodies' inertias given."""
    parts = tuple(limbs.limb_matrix(limb.above, limb.of(inertias), tree.axes(limb)) for limb in tree.limbs)
    root = tree.seen[0], None if tree.given is None else tree.given[0]
    return TreeMatrix(parts, limbs.root_matrix(inertias[0], root, tuple(part.at_root for part in parts)))


def solve(tree: Tree, matrix: TreeMatrix, momenta: Sequence[Screw]) -> Solved:
    """The rates that momenta, or forces, of all bodies stand for."""
    given, found = tree.impulses, []
    for limb, part in zip(tree.limbs, matrix.limbs, strict=True):
        found.append(limbs.limb_load(limb.above, part, limb.of(given), given[0], limb.of(momenta)))
    r = limbs.root_rates(matrix.root, given[0], momenta[0], tuple(push for _, push in found))
    return Solved(r, tuple(z for z, _ in found))


@dataclass(frozen=True)
class Moving:
    """Rates of the coordinates of each link (count,) and the screws of the bodies."""

    rates: Columns
    screws: tuple[Screw, ...]


def moving(tree: Tree, matrix: TreeMatrix, rates: Solved) -> Moving:
    """How all bodies move."""
    n = len(tree.seen)
    root = _root_moving(tree.seen[0], rates.r)
    turns, found = [rates.r] * n, [root] * n
    for limb, part, z in zip(tree.limbs, matrix.limbs, rates.z, strict=True):
        own, moved = _limb_moving(limb.above, part, limb.of(tree.seen), z, rates.r, root)
        for k, rate, screw in zip(limb.links, own, moved, strict=True):
            turns[k], found[k] = rate, screw
    return Moving(tuple(turns), tuple(found))


@traced
def _root_moving(axes: Expr, r: Expr) -> Screw:
    return Screw(ca.mtimes(axes, r))


@traced
def _limb_moving(
    above: Above, matrix: LimbMatrix, axes: Columns, z: Expr, r: Expr, root: Screw
) -> tuple[Columns, tuple[Screw, ...]]:
    rates = limbs.limb_rates(matrix, z, r)
    ends = [0]
    for columns in axes:
        ends.append(ends[-1] + columns.size2())
    moved = limbs.summed_down(above, axes, rates, root.parts)
    return tuple(ca.vertsplit(rates, ends)), tuple(Screw(screw) for screw in moved)
