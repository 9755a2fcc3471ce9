"""Linear feedback: gains times what is sensed, and offsets."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import casadi as ca

from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class Linear:
    """u = K o + b; see ``ControlLaw``. ``gains`` holds K row by row (m n,), ``offsets`` b (m,)."""

    summary: ClassVar[str] = "Gains times sensor values, plus offsets."
    example: ClassVar[str] = "{ gains = [[0.1, 0.2]] }"
    numbers: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "gains": "a row of numbers for each output, one for each sensor value; or 0",
            "offsets": "a number for each output; default 0",
        }
    )
    needed: ClassVar[tuple[str, ...]] = ()
    blind: ClassVar[bool] = False

    senses: int
    outputs: int

    @property
    def sizes(self) -> Mapping[str, int]:
        """Implement ``ControlLaw.sizes``."""
        return {"gains": self.outputs * self.senses, "offsets": self.outputs}

    def act(self, sensed: Expr, time: Expr, numbers: Mapping[str, Expr]) -> Expr:
        """Implement ``ControlLaw.act``."""
        return rows_times(numbers["gains"], sensed, self.outputs) + numbers["offsets"]


def rows_times(matrix: Expr, vector: Expr, rows: int) -> Expr:
    """(rows,) the product of a matrix, given row by row as one column, with a vector."""
    if not rows or not vector.shape[0]:
        return type(vector).zeros(rows)
    return ca.mtimes(ca.reshape(matrix, vector.shape[0], rows).T, vector)
