"""Trees of expressions: dataclasses, tuples, lists and dicts with matrices among their leaves."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import count
from typing import Any

import casadi as ca

from symphys.dynamics.tracing.decorator import traced
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class Leaf:
    """A matrix of a tree: its sparsity; ``pattern`` None: dense."""

    rows: int
    columns: int
    pattern: tuple[int, ...] | None


SCALAR = Leaf(1, 1, None)
Code = float | tuple[int, int]
"""An entry of a matrix: a constant, or (which slot, which place in it)."""


class TracedMatrix:
    """A matrix between two traced calls, by the codes of its entries, column by column.

    Arithmetic with it is traced; functions of casadi are called in traced functions.

    Attributes:
        leaf: its sparsity.
        kept: place for what a tracer knows of its codes; see ``structure``.
    """

    __slots__ = ("_codes", "_slots", "kept", "leaf")

    def __init__(self, leaf: Leaf, codes: tuple[Code, ...], slots: Sequence[int] | None = None) -> None:
        """Keep the codes; ``slots``: those that their slots number; None: codes have the slots themselves."""
        self.leaf, self._codes, self._slots = leaf, codes, slots
        self.kept: Any = None

    @property
    def codes(self) -> tuple[Code, ...]:
        """Return the keys of its entries."""
        slots = self._slots
        if slots is not None:
            self._codes = tuple([c if isinstance(c, float) else (slots[c[0]], c[1]) for c in self._codes])
            self._slots = None
        return self._codes

    def __eq__(self, other: object) -> bool:
        """Whether it is the same matrix of the same tracer."""
        return isinstance(other, TracedMatrix) and (self.leaf, self.codes) == (other.leaf, other.codes)

    def __hash__(self) -> int:
        """Equal for equal ones."""
        return hash((self.leaf, self.codes))

    @property
    def shape(self) -> tuple[int, int]:
        """Return rows and columns."""
        return self.leaf.rows, self.leaf.columns

    __add__, __radd__ = traced(lambda a, b: a + b), traced(lambda a, b: b + a)
    __sub__, __rsub__ = traced(lambda a, b: a - b), traced(lambda a, b: b - a)
    __mul__, __rmul__ = traced(lambda a, b: a * b), traced(lambda a, b: b * a)
    __truediv__, __rtruediv__ = traced(lambda a, b: a / b), traced(lambda a, b: b / a)
    __lt__, __gt__ = traced(lambda a, b: a < b), traced(lambda a, b: a > b)
    __neg__ = traced(lambda a: -a)
    __getitem__ = traced(lambda a, index: a[index])


@dataclass(frozen=True)
class TreeDef:
    """The structure of a node: its kind, its keys and its children. Of a value without children ``keys`` holds it."""

    kind: type
    keys: tuple[Hashable, ...]
    below: tuple[Any, ...]


def outline(matrix: Expr) -> Leaf:
    """Return the sparsity of an SX matrix."""
    return Leaf(matrix.size1(), matrix.size2(), None if matrix.is_dense() else tuple(matrix.sparsity().find()))


def flatten(tree: Any, leaves: list[Expr]) -> Hashable:
    """Return the shape of a tree, which compares equal for equal trees; its matrices are appended to ``leaves``.

    Whatever is neither a matrix nor a fork (numbers, texts, functions) belongs to the shape.
    """
    kind = type(tree)
    if kind is TracedMatrix:
        leaves.append(tree)
        return tree.leaf  # type: ignore[no-any-return]
    if kind is list or kind is tuple:
        return TreeDef(kind, (), tuple([flatten(part, leaves) for part in tree]))
    if kind is dict:
        return TreeDef(kind, tuple(tree), tuple([flatten(part, leaves) for part in tree.values()]))
    if isinstance(tree, ca.SX | ca.DM):
        leaves.append(tree if kind is ca.SX else ca.SX(tree))  # a copy costs as much as an addition
        return outline(leaves[-1])
    names = field_names(kind)  # type: ignore[arg-type]
    if names is not None:
        return TreeDef(kind, (), tuple([flatten(getattr(tree, name), leaves) for name in names]))
    return TreeDef(kind, (tree,), ())


@cache
def field_names(kind: type) -> tuple[str, ...] | None:
    """Return the fields of a dataclass; None for other types."""
    return tuple(field.name for field in fields(kind)) if is_dataclass(kind) else None


def unflatten(shape: Any, leaves: Iterator[Expr]) -> Any:
    """Return the tree of this shape with other matrices."""
    kind = type(shape)
    if kind is Leaf:
        return next(leaves)
    if shape.kind is dict:
        return dict(zip(shape.keys, [unflatten(part, leaves) for part in shape.below], strict=True))
    if shape.keys:
        return shape.keys[0]
    parts = [unflatten(part, leaves) for part in shape.below]
    return shape.kind(*parts) if field_names(shape.kind) is not None else shape.kind(parts)


def leaves_of(shape: Any, found: list[Leaf]) -> None:
    """Append the outlines of a tree's matrices, from its shape, in order."""
    if type(shape) is Leaf:
        found.append(shape)
    else:
        for part in shape.below:
            leaves_of(part, found)


def slots_of(shape: Any) -> list[int]:
    """Return for each matrix of a tree, in order, the slot that its entries lie in.

    Members of a tuple that are trees themselves have slots of their own, all else lies together.
    """
    found: list[int] = []
    numbers = count()

    def visit(part: Any, slot: int) -> None:
        if type(part) is Leaf:
            found.append(slot)
            return
        apart = part.kind is tuple and any(type(member) is TreeDef for member in part.below)
        for member in part.below:
            visit(member, next(numbers) if apart else slot)

    visit(shape, next(numbers))
    return found


def matrix(leaf: Leaf, entries: list[Expr]) -> Expr:
    """Return a matrix of this sparsity from its entries."""
    if leaf == SCALAR:
        return entries[0]
    column = ca.vertcat(*entries) if entries else ca.SX(0, 1)
    if leaf.pattern is None:
        return column if leaf.columns == 1 else ca.reshape(column, leaf.rows, leaf.columns)
    sparsity = ca.Sparsity.nonzeros(leaf.rows, leaf.columns, list(leaf.pattern))
    return ca.SX(sparsity, column)
