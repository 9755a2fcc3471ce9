"""The Schur complement of a kinematic tree's mass matrix on its root: one block for each branch, and the root's.

The rates of a branch are z + T r, with r those of the root and T = -M_ll^-1 M_lr: its motion as the root moves and
nothing acts on it. In (r, z) the branches are decoupled: an impulse b on one branch changes its z by M_ll^-1 b_l and r
by S^-1 (b_r - M_rl z), S = M_rr + sum M_rl T, and no other branch. So the cost of a projection does not depend on the
number of branches, and equal branches share their functions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from symphys.dynamics.articulated.factorisation import Factorisation, Sparse, factorise
from symphys.dynamics.tracing.decorator import traced
from symphys.records import dataclass
from symphys.types import Expr

Parents = tuple[int | None, ...]
"""For each link of a branch the place of its parent among them; None: the root of the tree."""
Columns = tuple[Expr, ...]
"""For each link its motion subspace (6, count)."""


@dataclass(frozen=True)
class MotionSubspaces:
    """The motion subspaces (6, count) of a branch's links and of the root (Featherstone's S).

    Attributes:
        velocity_axes, root_velocity_axes: at the time of the velocities.
        impulse_axes, root_impulse_axes: at the time of the impulses; None if that is the same.
    """

    velocity_axes: Columns
    root_velocity_axes: Expr
    impulse_axes: Columns | None = None
    root_impulse_axes: Expr | None = None

    @property
    def impulses(self) -> tuple[Columns, Expr]:
        """Return the motion subspaces at the time of the impulses, of the links and of the root."""
        if self.impulse_axes is None or self.root_impulse_axes is None:
            return self.velocity_axes, self.root_velocity_axes
        return self.impulse_axes, self.root_impulse_axes


@dataclass(frozen=True)
class BranchMatrix:
    """A branch of n coordinates as seen from a root of m.

    Attributes:
        block: its own mass matrix.
        follows: T (n, m).
        pushes: M_rl (m, n).
        at_root: (m, m) what it adds to the mass matrix of the root.
    """

    block: Factorisation
    follows: Expr
    pushes: Expr
    at_root: Expr


@dataclass(frozen=True)
class SpatialVector:
    """(6,): a velocity or a momentum about the origin; see ``spatial``."""

    parts: Expr


@dataclass(frozen=True)
class SpatialInertia:
    """(6, 6): momentum for a spatial vector."""

    matrix: Expr


def paths(above: Parents, axes: Columns) -> list[list[int]]:
    """Return for each link of a branch the branch's coordinates that move it."""
    found: list[list[int]] = []
    start = 0
    for parent, columns in zip(above, axes, strict=True):
        count = columns.size2()
        found.append([*([] if parent is None else found[parent]), *range(start, start + count)])
        start += count
    return found


@traced
def branch_matrix(
    above: Parents, inertias: Sequence[SpatialInertia], axes: MotionSubspaces, armature: tuple[Expr | None, ...]
) -> BranchMatrix:
    """Build from the inertias of a branch's bodies, and what is added to the diagonal of its coordinates."""
    # composite inertias, from leaves to root (Featherstone's composite-rigid-body algorithm)
    symmetric, (given, root_given) = axes.impulse_axes is None, axes.impulses
    total, base = summed_up(above, [inertia.matrix for inertia in inertias])
    velocity_matrix: Expr = ca.horzcat(*axes.velocity_axes)
    impulse_matrix: Expr = ca.horzcat(*given)
    n, m = velocity_matrix.size2(), axes.root_velocity_axes.size2()
    rows: list[Sparse] = [{} for _ in range(n)]
    pushes, pulls = ca.SX(m, n), ca.SX(n, m)
    # entries of the mass matrix along each path, and the coupling with the root
    for path, columns, inertia, added in zip(
        paths(above, axes.velocity_axes), axes.velocity_axes, total, armature, strict=True
    ):
        for k in path[len(path) - columns.size2() :]:
            momentum, reaction = ca.mtimes(inertia, velocity_matrix[:, k]), ca.mtimes(inertia.T, impulse_matrix[:, k])
            pushes[:, k] = ca.mtimes(root_given.T, momentum)
            pulls[k, :] = pushes[:, k].T if symmetric else ca.mtimes(axes.root_velocity_axes.T, reaction).T
            for i in [i for i in path if i <= k]:
                rows[i][k] = ca.dot(momentum, impulse_matrix[:, i])
                rows[k][i] = rows[i][k] if symmetric or i == k else ca.dot(reaction, velocity_matrix[:, i])
            rows[k][k] = rows[k][k] if added is None else rows[k][k] + added
    # T = -M_ll^-1 M_lr, and the branch's share of the root's matrix
    block = factorise(rows, symmetric)
    follows = ca.SX(n, m)
    for j in range(m):
        for k, value in block.solve({k: -pulls[k, j] for k in range(n)}).items():
            follows[k, j] = value
    at_root = ca.mtimes(root_given.T, ca.mtimes(base, axes.root_velocity_axes)) + ca.mtimes(pushes, follows)
    return BranchMatrix(block, follows, pushes, symmetric_copy(at_root) if symmetric else at_root)


@traced
def root_matrix(
    inertia: SpatialInertia, axes: tuple[Expr, Expr | None], branches: tuple[Expr, ...], armature: Expr | None
) -> Factorisation:
    """Return S, from the root's inertia, its motion subspaces for velocities and impulses, and the branches' shares.

    ``armature`` is added to the diagonal.
    """
    seen, given = axes
    whole = ca.mtimes((seen if given is None else given).T, ca.mtimes(inertia.matrix, seen))
    for each in branches:
        whole += each
    m = seen.size2()
    whole = whole if armature is None else whole + armature * ca.SX.eye(m)
    return factorise([{j: whole[i, j] for j in range(m)} for i in range(m)], given is None)


@traced
def branch_load(
    above: Parents,
    matrix: BranchMatrix,
    impulse_axes: Columns,
    root: Expr,
    momenta: Sequence[SpatialVector],
    rotors: tuple[Expr | None, ...],
) -> tuple[Expr, Expr]:
    """Return z (n,) and the load on the root (m,) of momenta, or forces, of a branch's bodies and rotors."""
    total, base = summed_up(above, [momentum.parts for momentum in momenta])
    right, start = dict[int, Expr](), 0
    for columns, screw, rotor in zip(impulse_axes, total, rotors, strict=True):
        along = ca.mtimes(columns.T, screw) + (0 if rotor is None else rotor)
        right |= {start + k: along[k] for k in range(columns.size2())}
        start += columns.size2()
    z = dense(matrix.block.solve(right), start)
    return z, ca.mtimes(root.T, base) - ca.mtimes(matrix.pushes, z)


@traced
def root_rates(
    matrix: Factorisation, given: Expr, momentum: SpatialVector, branches: tuple[Expr, ...], rotor: Expr | None
) -> Expr:
    """Return r (m,) of the root's own momentum, of that of its rotor and of the loads of branches."""
    right = ca.mtimes(given.T, momentum.parts) + (0 if rotor is None else rotor)
    for each in branches:
        right += each
    return solve_factored(matrix, right)


def solve_factored(matrix: Factorisation, right: Expr) -> Expr:
    """Return the solution (n,) for a right hand side (n,)."""
    n = right.size1()
    return dense(matrix.solve({k: right[k] for k in range(n) if right.has_nz(k, 0)}), n)


def branch_rates(matrix: BranchMatrix, z: Expr, r: Expr) -> Expr:
    """Return the rates (n,) of a branch's coordinates."""
    return z + ca.mtimes(matrix.follows, r)


def summed_up(above: Parents, parts: Sequence[Expr]) -> tuple[list[Expr], Expr]:
    """Return for each link of a branch the sum over its subtree, and the sum of all."""
    total = list(parts)
    for k, parent in reversed(list(enumerate(above))):
        if parent is not None:
            total[parent] = total[parent] + total[k]
    return total, sum(total[k] for k, parent in enumerate(above) if parent is None)


def summed_down(above: Parents, axes: Columns, rates: Expr, root: Expr) -> list[Expr]:
    """Return the spatial velocity (6,) of each link of a branch, from the branch's rates and the root's velocity."""
    found: list[Expr] = []
    start = 0
    for parent, columns in zip(above, axes, strict=True):
        end = start + columns.size2()
        found.append((root if parent is None else found[parent]) + ca.mtimes(columns, rates[start:end, 0]))
        start = end
    return found


def symmetric_copy(matrix: Expr) -> Expr:
    """Return a symmetric matrix whose halves are the same expressions."""
    return ca.triu2symm(ca.triu(ca.densify(matrix)))


def dense(entries: Mapping[int, Expr], n: int) -> Expr:
    """Return a sparse vector (n,), zeros left out."""
    found = ca.SX(n, 1)
    for k, value in entries.items():
        found[k] = value
    return found
