"""A formula after parsing: a tree that casadi evaluates. Every node keeps its piece of the text for errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, Literal

import casadi as ca

from symphys.expression.columns import FormulaError, UnfitError, column
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.types import Expr


@dataclass(frozen=True)
class Constant:
    """A casadi.DM column of finite numbers."""

    value: Expr


@dataclass(frozen=True)
class Reference:
    """A name, which is looked up in the namespace."""

    name: str


@dataclass(frozen=True)
class Apply:
    """The application of a function to columns."""

    function: Callable[..., Expr]
    arguments: tuple[Node, ...]
    piece: str


Node = Constant | Reference | Apply


def evaluate(node: Node, namespace: Mapping[str, Any]) -> Expr:
    """Return the value of the tree: a casadi column."""
    if isinstance(node, Constant):
        return node.value
    if isinstance(node, Reference):
        return look_up(node.name, namespace)
    return call(node.function, [evaluate(argument, namespace) for argument in node.arguments], node.piece)


def renamed(node: Node, names: Mapping[str, str]) -> Node:
    """Return the tree with other names in place of some."""
    if isinstance(node, Reference):
        return Reference(names.get(node.name, node.name))
    if isinstance(node, Apply):
        return Apply(node.function, tuple(renamed(argument, names) for argument in node.arguments), node.piece)
    return node


def look_up(name: str, namespace: Mapping[str, Any]) -> Expr:
    """Return the value of a name; FormulaError with similar names if it is unknown."""
    if name not in namespace:
        raise FormulaError(f"unknown name {quote(name)}; {hint(name, namespace)}")
    value = namespace[name]
    return call(column, [value() if callable(value) else value], name)


def call(function: Callable[..., Expr], values: list[Any], piece: str) -> Expr:
    """Return the value of a function; an UnfitError becomes a FormulaError that names the piece."""
    try:
        return function(*values)
    except UnfitError as error:
        raise FormulaError(f"in {quote(piece)}: {error}") from None


def apply(function: Callable[..., Expr], arguments: tuple[Node, ...], piece: str) -> Node:
    """Return the application of a function; an application to constants is evaluated, and must be finite."""
    if not all(isinstance(argument, Constant) for argument in arguments):
        return Apply(function, arguments, piece)
    value = call(function, [argument.value for argument in arguments if isinstance(argument, Constant)], piece)
    if not value.is_regular():
        raise FormulaError(f"{quote(piece)} is not a finite real number")
    return Constant(value)


@dataclass(frozen=True)
class Formula:
    """A formula that has been read and has allowed pieces only.

    Attributes:
        text: as written.
        names: every name that it needs, such as ``ball.velocity`` or ``time``; those of its parts as they are written,
            such as ``end.knee.angle``.
        parts: its pieces of a whole motion; none for a formula of an instant.
    """

    text: str
    names: frozenset[str]
    root: Node = field(repr=False, compare=False)
    parts: tuple[MotionPart, ...] = field(default=(), repr=False, compare=False)

    @property
    def needed(self) -> frozenset[str]:
        """Names of all quantities that it needs, including those in its parts."""
        own = self.names - {part.name for part in self.parts}
        return own.union(*(part.formula.names for part in self.parts))

    def renamed(self, names: Mapping[str, str]) -> Formula:
        """Return the formula of an instant with other names in place of some; its text stays as written."""
        needed = frozenset(names.get(name, name) for name in self.names)
        return Formula(self.text, needed, renamed(self.root, names))

    def evaluate(self, namespace: Mapping[str, Any]) -> Expr:
        """Return the value as a dense casadi column (n,) of SX, MX or DM; (1,) for a number.

        ``namespace`` maps every name to a number, a sequence of numbers or a casadi column, or to a function that
        returns one and is called where the formula uses the name; SX and MX do not mix.
        FormulaError for an unknown name or shapes that do not fit.
        """
        return ca.densify(evaluate(self.root, namespace))


@dataclass(frozen=True)
class MotionPart:
    """A number or vector that a formula takes from a whole motion.

    Attributes:
        name: how the formula refers to it: ``end.knee.angle``, ``integral(sumsqr(ball.force))``.
        kind: a formula's value at the start or at the end, or its integral or average over time.
        formula: of an instant.
    """

    name: str
    kind: Literal["start", "end", "integral", "average"]
    formula: Formula
