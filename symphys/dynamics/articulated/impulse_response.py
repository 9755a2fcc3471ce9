"""Responses of a tree's generalized velocities to impulses along its coordinates and on its bodies."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.articulated.branches import Tree, TreeMatrix
from symphys.dynamics.articulated.factorisation import Factorisation
from symphys.dynamics.articulated.schur_complement import BranchMatrix, Columns, Parents, dense, paths, solve_factored
from symphys.dynamics.motion import BodyJacobian
from symphys.dynamics.tracing.decorator import traced
from symphys.maths.rotation import cross_matrix
from symphys.records import dataclass
from symphys.types import Expr

Response = tuple[Expr, Expr]
"""The rate of a coordinate by the numbers (1, n), and what a unit impulse along it does to them (n,)."""
Numbering = tuple[tuple[int, ...], ...]
"""The indices, among the n numbers, of the root's and of each branch's."""


@dataclass(frozen=True)
class BodyPlace:
    """A body at the time of the velocities: (3,) from the origin of spatial vectors, (3, 3) inertia, world frame."""

    place: Expr
    inertia: Expr


def numbering(tree: Tree) -> Numbering:
    """Return the numbers of root and branches, which are in the order of the coordinates."""
    return tuple(tree.kinematic_tree.links[0].coordinates), *(branch.coordinates for branch in tree.branches)


def scatter(places: Numbering, parts: Sequence[Expr], n: int | None = None) -> Expr:
    """Return the rows of parts at their places among all numbers (n, k), zeros left out.

    N None: as many as there are places.
    """
    found = ca.SX(sum(map(len, places)) if n is None else n, parts[0].size2())
    for each, part in zip(places, parts, strict=True):
        for row, i in enumerate(each):
            for column in range(part.size2()):
                if part.has_nz(row, column):
                    found[i, column] = part[row, column]
    return found


def coordinate_responses(tree: Tree, matrix: TreeMatrix, acting: Sequence[bool]) -> tuple[Response | None, ...]:
    """Return the responses of all coordinates; None for links along which nothing acts."""
    found, (root, *_), links = dict[int, Response](), numbering(tree), tree.kinematic_tree.links
    for k in root if acting[0] else ():
        found[k] = _root_coordinate_response(k, tree.kinematic_tree.size, matrix.root)
    for branch, part in zip(tree.branches, matrix.branches, strict=True):
        wanted = [on for link, on in zip(branch.of(links), branch.of(acting), strict=True) for _ in link.coordinates]
        for a, k in enumerate(branch.coordinates):
            if wanted[a]:
                given = _branch_coordinate_response(a, part, matrix.root)
                places = root, branch.coordinates
                found[k] = _scatter_response(a, tree.kinematic_tree.size, places, part.follows, given)
    return tuple(found.get(k) for k in range(tree.kinematic_tree.size))


@traced
def _root_coordinate_response(k: int, n: int, root: Factorisation) -> Response:
    row = ca.SX(1, n)
    row[0, k] = 1
    return row, scatter(
        (tuple(range(root.pivots.size1())),), (dense(root.solve({k: ca.SX(1)}), root.pivots.size1()),), n
    )


@traced
def _branch_coordinate_response(k: int, matrix: BranchMatrix, root: Factorisation) -> tuple[Expr, Expr]:
    """Return the response of the root and of the branch to a unit impulse along coordinate ``k`` of the branch."""
    z = dense(matrix.block.solve({k: ca.SX(1)}), matrix.follows.size1())
    reaching: Expr = ca.mtimes(matrix.pushes, z)
    return solve_factored(root, -reaching), z


@traced
def _scatter_response(k: int, n: int, places: Numbering, follows: Expr, given: tuple[Expr, Expr]) -> Response:
    unit = ca.SX(follows.size1(), 1)
    unit[k] = 1
    return scatter(places, (follows[k, :].T, unit), n).T, scatter(places, given, n)


def body_jacobians(
    tree: Tree, matrix: TreeMatrix, bodies: Sequence[tuple[Expr, BodyPlace] | None]
) -> tuple[BodyJacobian | None, ...]:
    """Return the Jacobian of each link's body, from its place at the time of impulses (3,) and of velocities.

    None: none.
    """
    found: list[BodyJacobian | None] = [None for _ in bodies]
    (root, *_), n, given = numbering(tree), tree.kinematic_tree.size, tree.impulses
    if bodies[0] is not None:
        counted, body = bodies[0]
        parts = _root_jacobian(tree.velocity_axes[0], body.place), _root_response(matrix.root, given[0], counted)
        found[0] = _body_jacobian(n, (root,), *parts, body.inertia)
    for branch, part in zip(tree.branches, matrix.branches, strict=True):
        for a, k in enumerate(branch.links):
            if (each := bodies[k]) is not None:
                counted, body = each
                see = _branch_jacobian(
                    branch.above, a, part.follows, branch.of(tree.velocity_axes), tree.velocity_axes[0], body.place
                )
                response = _branch_response(branch.above, a, part, matrix.root, branch.of(given), given[0], counted)
                found[k] = _body_jacobian(n, (root, branch.coordinates), see, response, body.inertia)
    return tuple(found)


@traced
def _body_jacobian(n: int, places: Numbering, see: Columns, response: Columns, inertia: Expr) -> BodyJacobian:
    """Scatter the (6, k) and (k, 6) responses of the root and the branch to their places."""
    numbers = scatter(places, response, n)
    return BodyJacobian(scatter(places, [part.T for part in see], n).T, inertia, numbers[:, :3], numbers[:, 3:])


@traced
def _root_jacobian(axes: Expr, place: Expr) -> Columns:
    return (_at_place(axes, place),)


@traced
def _branch_jacobian(above: Parents, link: int, follows: Expr, axes: Columns, root: Expr, place: Expr) -> Columns:
    path, own = paths(above, axes)[link], _side_by_side(axes)
    columns = ca.SX(6, own.size2())
    columns[:, path] = own[:, path]
    return _at_place(root + ca.mtimes(own[:, path], follows[path, :]), place), _at_place(columns, place)


def _at_place(columns: Expr, place: Expr) -> Expr:
    """Return spatial vectors (6, k) as velocity at a place above angular velocity."""
    return ca.vertcat(columns[3:, :] - ca.mtimes(cross_matrix(place), columns[:3, :]), columns[:3, :])


@traced
def _root_response(root: Factorisation, axes: Expr, place: Expr) -> Columns:
    right: Expr = ca.mtimes(axes.T, _unit_impulses(place))
    return (ca.horzcat(*(solve_factored(root, right[:, k]) for k in range(6))),)


@traced
def _branch_response(
    above: Parents, link: int, matrix: BranchMatrix, root: Factorisation, axes: Columns, root_axes: Expr, place: Expr
) -> Columns:
    """Return the responses (m, 6) of the root and (n, 6) of the branch."""
    impulses, own = _unit_impulses(place), _side_by_side(axes)
    path, n = paths(above, axes)[link], own.size2()
    z = [dense(matrix.block.solve({k: ca.dot(own[:, k], impulses[:, i]) for k in path}), n) for i in range(6)]
    reaching = [ca.mtimes(root_axes.T, impulses[:, i]) - ca.mtimes(matrix.pushes, z[i]) for i in range(6)]
    return ca.horzcat(*(solve_factored(root, each) for each in reaching)), ca.horzcat(*z)


def _side_by_side(axes: Columns) -> Expr:
    return ca.horzcat(*axes)


def _unit_impulses(place: Expr) -> Expr:
    """Return the spatial momenta (6, 6) about the origin of unit impulses at a place and of unit torque impulses."""
    unit = ca.SX.eye(3)
    return ca.vertcat(ca.horzcat(cross_matrix(place), unit), ca.horzcat(unit, ca.SX(3, 3)))
