"""The sweeps' unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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


Moved = Momentum | Rates | None
"""Of a body; of a tree, at its root; None for the other bodies of a tree."""
Momenta = tuple[Momentum, ...]
States = tuple[Moved, ...]
