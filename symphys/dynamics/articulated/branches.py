"""A tree's mass matrix branch by branch: each branch has its own traced calls, which equal branches share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.articulated import schur_complement, spatial
from symphys.dynamics.articulated.factorisation import Factorisation
from symphys.dynamics.articulated.schur_complement import (
    BranchMatrix,
    Columns,
    MotionSubspaces,
    Parents,
    SpatialInertia,
    SpatialVector,
)
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.tracing.decorator import traced
from symphys.model.joints import KinematicTree
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class Branch:
    """A branch: the links below one child of the root.

    Attributes:
        links: among those of the tree.
        above: see ``schur_complement.Parents``.
        coordinates: among those of the tree.
    """

    links: tuple[int, ...]
    above: Parents
    coordinates: tuple[int, ...]

    def of(self, parts: Sequence[Any]) -> tuple[Any, ...]:
        """Select the branch's items of those of all links of the tree."""
        return tuple(parts[k] for k in self.links)


def branches_of(kinematic_tree: KinematicTree) -> tuple[Branch, ...]:
    """Return the branches of a tree."""
    place = {link.body: k for k, link in enumerate(kinematic_tree.links)}
    members: list[list[int]] = []
    branch_of: dict[int, list[int]] = {}
    for k, link in enumerate(kinematic_tree.links[1:], 1):
        parent = place[link.parent] if link.parent is not None else 0
        if parent == 0:
            members.append([])
        branch_of[k] = branch_of[parent] if parent else members[-1]
        branch_of[k].append(k)
    found = []
    for links in members:
        above = (kinematic_tree.links[k].parent for k in links)
        parents = tuple(links.index(place[i]) if i is not None and place[i] else None for i in above)
        own = (
            range(kinematic_tree.links[k].start, kinematic_tree.links[k].start + kinematic_tree.links[k].count)
            for k in links
        )
        found.append(Branch(tuple(links), parents, tuple(j for each in own for j in each)))
    return tuple(found)


@dataclass(frozen=True)
class Tree:
    """A kinematic tree at an instant, or between two, with the motion subspaces (6, count) of its links.

    ``armature``: of each link what is added to its coordinates' diagonal of the mass matrix; None where nothing is.
    """

    kinematic_tree: KinematicTree
    velocity_axes: Columns
    impulse_axes: Columns | None = None
    armature: tuple[Expr | None, ...] = ()

    @property
    def branches(self) -> tuple[Branch, ...]:
        """Return the branches of the tree."""
        return branches_of(self.kinematic_tree)

    def axes(self, branch: Branch) -> MotionSubspaces:
        """Return the motion subspaces of a branch and of the root."""
        if self.impulse_axes is None:
            return MotionSubspaces(branch.of(self.velocity_axes), self.velocity_axes[0])
        return MotionSubspaces(
            branch.of(self.velocity_axes), self.velocity_axes[0], branch.of(self.impulse_axes), self.impulse_axes[0]
        )

    @property
    def impulses(self) -> Columns:
        """Return the motion subspaces at the time of the impulses."""
        return self.velocity_axes if self.impulse_axes is None else self.impulse_axes


@dataclass(frozen=True)
class TreeMatrix:
    """The mass matrix of a tree, factored."""

    branches: tuple[BranchMatrix, ...]
    root: Factorisation


@dataclass(frozen=True)
class TreeRates:
    """Rates r of a root, and what branches do beside following it, z of each."""

    r: Expr
    z: tuple[Expr, ...]


def axes_at(
    kinematic_tree: KinematicTree, joints: spatial.Joints, body_paths: Sequence[PredictedPath], t: Expr, origin: Expr
) -> Columns:
    """Return the motion subspaces of all links at time t."""
    place = {link.body: k for k, link in enumerate(kinematic_tree.links)}
    found = []
    for link, joint, body_path in zip(kinematic_tree.links, joints, body_paths, strict=True):
        own = (body_path,) if link.parent is None else (body_path, body_paths[place[link.parent]])
        found.append(spatial.axes_of(joint, link.sign, own, t, origin))
    return tuple(found)


def tree_matrix(tree: Tree, inertias: Sequence[SpatialInertia]) -> TreeMatrix:
    """Build from a tree and the inertias of its bodies."""
    parts = tuple(
        schur_complement.branch_matrix(branch.above, branch.of(inertias), tree.axes(branch), branch.of(tree.armature))
        for branch in tree.branches
    )
    root = tree.velocity_axes[0], None if tree.impulse_axes is None else tree.impulse_axes[0]
    reached = tuple(part.at_root for part in parts)
    return TreeMatrix(parts, schur_complement.root_matrix(inertias[0], root, reached, tree.armature[0]))


def solve(
    tree: Tree, matrix: TreeMatrix, momenta: Sequence[SpatialVector], rates: Sequence[Expr | None] = ()
) -> TreeRates:
    """Return the rates that momenta, or forces, of all bodies stand for; ``rates`` (count,) are those of rotors."""
    given, found = tree.impulses, []
    rotors = tuple(
        None if rate is None else _rotor_momentum(armature, rate)
        for armature, rate in zip(tree.armature, rates or (None,) * len(given), strict=True)
    )
    for branch, part in zip(tree.branches, matrix.branches, strict=True):
        own = branch.of(given), given[0], branch.of(momenta), branch.of(rotors)
        found.append(schur_complement.branch_load(branch.above, part, *own))
    reached = tuple(push for _, push in found)
    r = schur_complement.root_rates(matrix.root, given[0], momenta[0], reached, rotors[0])
    return TreeRates(r, tuple(z for z, _ in found))


@traced
def _rotor_momentum(armature: Expr, rate: Expr) -> Expr:
    return armature * rate


@dataclass(frozen=True)
class TreeMotion:
    """Rates of the coordinates of each link (count,) and the spatial velocities of the bodies."""

    rates: Columns
    screws: tuple[SpatialVector, ...]


def tree_motion(tree: Tree, matrix: TreeMatrix, rates: TreeRates) -> TreeMotion:
    """Return the motions of all bodies."""
    n = len(tree.velocity_axes)
    root = _root_moving(tree.velocity_axes[0], rates.r)
    turns, found = [rates.r] * n, [root] * n
    for branch, part, z in zip(tree.branches, matrix.branches, rates.z, strict=True):
        own, moved = _branch_moving(branch.above, part, branch.of(tree.velocity_axes), z, rates.r, root)
        for k, rate, screw in zip(branch.links, own, moved, strict=True):
            turns[k], found[k] = rate, screw
    return TreeMotion(tuple(turns), tuple(found))


@traced
def _root_moving(axes: Expr, r: Expr) -> SpatialVector:
    return SpatialVector(ca.mtimes(axes, r))


@traced
def _branch_moving(
    above: Parents, matrix: BranchMatrix, axes: Columns, z: Expr, r: Expr, root: SpatialVector
) -> tuple[Columns, tuple[SpatialVector, ...]]:
    rates = schur_complement.branch_rates(matrix, z, r)
    ends = [0]
    for columns in axes:
        ends.append(ends[-1] + columns.size2())
    moved = schur_complement.summed_down(above, axes, rates, root.parts)
    return tuple(ca.vertsplit(rates, ends)), tuple(SpatialVector(screw) for screw in moved)
