"""Sparse elimination of a tree's mass matrix: leaves first, so that nothing fills in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Expr = Any
"""casadi SX"""
Sparse = dict[int, Expr]
"""Entries of a vector by index; what is not there is zero."""


class Eliminated:
    """A square matrix whose entry (i, j) is zero unless i and j are on one path from the root, factored without pivots.

    Indices grow from the root to the leaves.
    """

    def __init__(self, rows: list[Sparse]) -> None:
        """Factor it; ``rows`` by index."""
        self._rows = [dict(row) for row in rows]
        self._shares: list[Sparse] = [{} for _ in rows]
        for k in reversed(range(len(rows))):
            pivot = self._rows[k]
            for i in range(k):
                if k in self._rows[i]:
                    share = self._rows[i].pop(k) / pivot[k]
                    self._shares[k][i] = share
                    for j, entry in pivot.items():
                        if j < k:
                            self._rows[i][j] = self._rows[i].get(j, 0) - share * entry

    def solve(self, right: Mapping[int, Expr]) -> Sparse:
        """The solution for a right hand side."""
        reduced = dict(right)
        for k in reversed(range(len(self._rows))):
            if k in reduced:
                for i, share in self._shares[k].items():
                    reduced[i] = reduced.get(i, 0) - share * reduced[k]
        found: Sparse = {}
        for k, row in enumerate(self._rows):
            known = [entry * found[j] for j, entry in row.items() if j < k and j in found]
            if known or k in reduced:
                found[k] = (reduced.get(k, 0) - sum(known)) / row[k]
        return found
