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


Momenta = tuple[Momentum, ...]
