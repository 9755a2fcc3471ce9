"""The public type of a formula."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from symphys.expression.columns import Expr
from symphys.expression.tree import Node, evaluate


@dataclass(frozen=True)
class Formula:
    """A formula that has been read and found to hold allowed pieces only.

    Attributes:
        text: as written.
        names: every name that it needs, such as ``ball.velocity`` or ``time``.
    """

    text: str
    names: frozenset[str]
    root: Node = field(repr=False, compare=False)

    def evaluate(self, namespace: Mapping[str, Any]) -> Expr:
        """The value as a dense casadi column (n,) of SX, MX or DM; (1,) for a number.

        ``namespace`` maps every name to a number, a sequence of numbers or a casadi column; SX and MX do not mix.
        FormulaError for an unknown name or shapes that do not fit.
        """
        return ca.densify(evaluate(self.root, namespace))
