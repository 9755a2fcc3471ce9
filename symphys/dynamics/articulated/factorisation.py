"""Sparse elimination of a tree's mass matrix: leaves first, so that nothing fills in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from symphys.records import dataclass
from symphys.types import Expr

Sparse = dict[int, Expr]
"""Entries of a vector by index; what is not there is zero."""
MIN_PIVOT_SHARE = 1e-15
"""Smallest pivot as a share of its entry on the diagonal: a smaller one is rounding, as of joints far apart."""
MIN_PIVOT = 1e-60
"""[kg m^2] or [kg] Smallest pivot where that entry is 0."""


@dataclass(frozen=True)
class Factorisation:
    """A square matrix whose entry (i, j) is zero unless i and j are on one path from the root, factored without pivots.

    Indices grow from the root to the leaves.

    Attributes:
        lower: (n, n) in (i, k), i < k, the share of row k that was taken off row i.
        upper: (n, n) in (j, k), j < k, entry j of row k when it was taken off, by its pivot.
        pivots: (n,) reciprocals.
    """

    lower: Expr
    upper: Expr
    pivots: Expr

    def matrix(self) -> Expr:
        """Return the matrix (n, n) that was factored."""
        unit = ca.SX.eye(self.pivots.size1())
        return ca.mtimes(unit + self.lower, ca.mtimes(ca.diag(1 / self.pivots), unit + self.upper.T))

    def solve(self, right: Mapping[int, Expr]) -> Sparse:
        """Return the solution for a right hand side."""
        reduced = dict(right)
        n = self.pivots.size1()
        for k in reversed(range(n)):
            for i in range(k) if k in reduced else ():
                if self.lower.has_nz(i, k):
                    reduced[i] = reduced.get(i, 0) - self.lower[i, k] * reduced[k]
        found: Sparse = {}
        for k in range(n):
            known = [self.upper[j, k] * found[j] for j in range(k) if j in found and self.upper.has_nz(j, k)]
            if known or k in reduced:
                found[k] = reduced.get(k, 0) * self.pivots[k] - sum(known)
        return found


def reciprocal(x: Expr) -> Expr:
    """Return 1 / x, written so that products with it stay products: casadi makes x / y of x times 1 / y."""
    return 2 / (2 * x)


def factorise(rows: Sequence[Mapping[int, Expr]], symmetric: bool = False) -> Factorisation:
    """Return the factors of a matrix by its rows; of a symmetric one those of one half serve both."""
    left, n = [dict(row) for row in rows], len(rows)
    lower, upper, pivots = ca.SX(n, n), ca.SX(n, n), ca.SX(n, 1)
    for k in reversed(range(n)):
        least = MIN_PIVOT_SHARE * ca.fabs(rows[k][k]) + MIN_PIVOT
        pivots[k] = reciprocal(ca.if_else(ca.fabs(left[k][k]) < least, least, left[k][k]))
        above = [j for j in left[k] if j < k]
        for j in above:
            upper[j, k] = left[k][j] * pivots[k]
        for i in [i for i in range(k) if k in left[i]]:
            lower[i, k] = upper[i, k] if symmetric else left[i][k] * pivots[k]
            for j in above if not symmetric else [j for j in above if j <= i]:
                left[i][j] = left[i].get(j, 0) - lower[i, k] * left[k][j]
                if symmetric:
                    left[j][i] = left[i][j]
    return Factorisation(lower, upper, pivots)
