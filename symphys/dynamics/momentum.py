"""The sweeps' unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

Expr = Any
"""casadi SX"""


@dataclass(frozen=True)
class Momentum:
    """The sweeps' unknowns of one body at mid-step: velocity (3,) [m/s], angular momentum (3,) [N m s]."""

    velocity: Expr
    angular: Expr


@dataclass(frozen=True)
class Rates:
    """The sweeps' unknowns of a tree of bodies at mid-step: rates (n,) of its coordinates [m/s], [rad/s]."""

    numbers: Expr

    def along(self, matrix: Expr) -> Expr:
        """(m,): ``matrix`` (m, n) times the rates; added in pairs, so that no term waits for all others."""
        rows = []
        for i in range(matrix.size1()):
            terms = [matrix[i, j] * self.numbers[j] for j in range(matrix.size2()) if matrix.has_nz(i, j)]
            while len(terms) > 1:
                terms = [sum(terms[k + 1 : k + 2], terms[k]) for k in range(0, len(terms), 2)]
            rows.append(terms[0] if terms else ca.SX(0))
        return ca.vertcat(*rows)


Moved = Momentum | Rates | None
"""Of a body; of a tree, at its root; None for the other bodies of a tree."""
Momenta = tuple[Momentum, ...]
States = tuple[Moved, ...]
