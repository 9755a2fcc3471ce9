"""A formula after parsing: a tree that casadi evaluates. Every node keeps its piece of the text for errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from symphys.expression.columns import column
from symphys.expression.errors import FormulaError, UnfitError
from symphys.suggest import hint, quote
from symphys.types import Expr


@dataclass(frozen=True)
class Constant:
    """A casadi.DM column of finite numbers."""

    value: Expr


@dataclass(frozen=True)
class Reference:
    """A name, to be looked up in the namespace."""

    name: str


@dataclass(frozen=True)
class Apply:
    """A function of columns, applied."""

    function: Callable[..., Expr]
    arguments: tuple[Node, ...]
    piece: str


Node = Constant | Reference | Apply


def evaluate(node: Node, namespace: Mapping[str, Any]) -> Expr:
    """The value of the tree: a casadi column."""
    if isinstance(node, Constant):
        return node.value
    if isinstance(node, Reference):
        return look_up(node.name, namespace)
    return call(node.function, [evaluate(argument, namespace) for argument in node.arguments], node.piece)


def renamed(node: Node, names: Mapping[str, str]) -> Node:
    """The tree with other names in place of some."""
    if isinstance(node, Reference):
        return Reference(names.get(node.name, node.name))
    if isinstance(node, Apply):
        return Apply(node.function, tuple(renamed(argument, names) for argument in node.arguments), node.piece)
    return node


def look_up(name: str, namespace: Mapping[str, Any]) -> Expr:
    """The value of a name; FormulaError that says which names come close."""
    if name not in namespace:
        raise FormulaError(f"unknown name {quote(name)}; {hint(name, namespace)}")
    value = namespace[name]
    return call(column, [value() if callable(value) else value], name)


def call(function: Callable[..., Expr], values: list[Any], piece: str) -> Expr:
    """The function's value; a shape that does not fit becomes a FormulaError that names the piece."""
    try:
        return function(*values)
    except UnfitError as error:
        raise FormulaError(f"in {quote(piece)}: {error}") from None


def apply(function: Callable[..., Expr], arguments: tuple[Node, ...], piece: str) -> Node:
    """The application of a function; one of constants is worked out at once and must be finite."""
    if not all(isinstance(argument, Constant) for argument in arguments):
        return Apply(function, arguments, piece)
    value = call(function, [argument.value for argument in arguments if isinstance(argument, Constant)], piece)
    if not value.is_regular():
        raise FormulaError(f"{quote(piece)} is not a finite real number")
    return Constant(value)
