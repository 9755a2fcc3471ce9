"""The public type of a formula."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import casadi as ca

from symphys.expression.tree import Node, evaluate, renamed
from symphys.types import Expr


@dataclass(frozen=True)
class Formula:
    """A formula that has been read and found to hold allowed pieces only.

    Attributes:
        text: as written.
        names: every name that it needs, such as ``ball.velocity`` or ``time``; those of its parts as they are written,
            such as ``end.knee.angle``.
        parts: what it takes of a whole motion; none: it is a formula of an instant.
    """

    text: str
    names: frozenset[str]
    root: Node = field(repr=False, compare=False)
    parts: tuple[MotionPart, ...] = field(default=(), repr=False, compare=False)

    @property
    def needed(self) -> frozenset[str]:
        """Every name of a quantity that it needs, those in its parts too."""
        own = self.names - {part.name for part in self.parts}
        return own.union(*(part.formula.names for part in self.parts))

    def renamed(self, names: Mapping[str, str]) -> Formula:
        """The formula of an instant with other names in place of some; its text stays as written."""
        needed = frozenset(names.get(name, name) for name in self.names)
        return Formula(self.text, needed, renamed(self.root, names))

    def evaluate(self, namespace: Mapping[str, Any]) -> Expr:
        """The value as a dense casadi column (n,) of SX, MX or DM; (1,) for a number.

        ``namespace`` maps every name to a number, a sequence of numbers or a casadi column, or to a function that
        returns one and is called where the formula uses the name; SX and MX do not mix.
        FormulaError for an unknown name or shapes that do not fit.
        """
        return ca.densify(evaluate(self.root, namespace))


@dataclass(frozen=True)
class MotionPart:
    """A number or vector that a formula takes of a whole motion.

    Attributes:
        name: how the formula refers to it: ``end.knee.angle``, ``integral(sumsqr(ball.force))``.
        kind: a formula's value at the start or at the end, or its integral or average over time.
        formula: of an instant.
    """

    name: str
    kind: Literal["start", "end", "integral", "average"]
    formula: Formula
