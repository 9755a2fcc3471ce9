"""A tree's mass matrix with the limbs that hang on its root taken apart.

The rates of a limb are z + T r, with r those of the root and T = -M_ll^-1 M_lr: what it does as the root moves and
nothing acts on it. In (r, z) limbs do not know of each other: an impulse b on one limb changes its z by M_ll^-1 b_l and
r by S^-1 (b_r - M_rl z), S = M_rr + sum M_rl T, and no other limb. So what sweeps visit stays small however many limbs
there are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from symphys.step.elimination import Eliminated, Sparse

Expr = Any
"""casadi SX"""


class Limbs:
    """The matrix, factored."""

    def __init__(self, rows: Sequence[Sparse], limbs: Sequence[Sequence[int]]) -> None:
        """Factor it; ``rows`` by index, ``limbs`` the indices of each, the others are the root's."""
        self._rows, self._limbs = rows, limbs
        inside = {k for limb in limbs for k in limb}
        self._root = [k for k in range(len(rows)) if k not in inside]
        self._blocks = [Eliminated([_renumbered(rows[k], limb) for k in limb]) for limb in limbs]
        self.follows: list[dict[tuple[int, int], Expr]] = [self._following(i) for i in range(len(limbs))]
        whole = [_renumbered(rows[k], self._root) for k in self._root]
        for limb, follows in zip(limbs, self.follows, strict=True):
            for a, i in enumerate(self._root):
                for k in limb:
                    for b, j in enumerate(self._root):
                        if k in rows[i] and (k, j) in follows:
                            whole[a][b] = whole[a].get(b, 0) + rows[i][k] * follows[k, j]
        self._schur = Eliminated(whole)

    def _following(self, index: int) -> dict[tuple[int, int], Expr]:
        """T of a limb, by (its index, the root's)."""
        limb = self._limbs[index]
        found: dict[tuple[int, int], Expr] = {}
        for j in self._root:
            right = {a: -self._rows[k][j] for a, k in enumerate(limb) if j in self._rows[k]}
            found |= {(limb[a], j): value for a, value in self._blocks[index].solve(right).items()}
        return found

    def solve(self, right: Mapping[int, Expr]) -> Sparse:
        """(r, z) for a right hand side."""
        found: Sparse = {}
        reduced = {k: right[k] for k in self._root if k in right}
        for limb, block in zip(self._limbs, self._blocks, strict=True):
            own = block.solve({a: right[k] for a, k in enumerate(limb) if k in right})
            for a, value in own.items():
                found[limb[a]] = value
                for i in self._root:
                    if limb[a] in self._rows[i]:
                        reduced[i] = reduced.get(i, 0) - self._rows[i][limb[a]] * value
        solved = self._schur.solve({a: reduced[i] for a, i in enumerate(self._root) if i in reduced})
        return found | {self._root[a]: value for a, value in solved.items()}

    def seen(self, columns: Mapping[int, Expr]) -> dict[int, Expr]:
        """What depends on the rates as columns times rates, by (r, z)."""
        found = dict(columns)
        for follows in self.follows:
            for (k, j), share in follows.items():
                if k in columns:
                    found[j] = found.get(j, 0) + columns[k] * share
        return found


def _renumbered(row: Sparse, indices: Sequence[int]) -> Sparse:
    return {a: row[k] for a, k in enumerate(indices) if k in row}


def matrix_of(follows: Sequence[Mapping[tuple[int, int], Expr]], n: int) -> Expr:
    """(n, n): (r, z) to rates."""
    found = ca.SX.eye(n)
    for each in follows:
        for (k, j), share in each.items():
            found[k, j] = share
    return found
