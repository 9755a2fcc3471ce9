"""The structure of trees as numbers, so that a call finds what was built for arguments of the same structure.

Two trees have the same number if they have the same shape, the same constants, and entries at the same places of slots
of the same sizes, where equal slots stand for equal slots. Trees share most of their branches with trees that were
looked at before, so a dataclass is looked at once: what a call returns has the numbers of its template.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.tracing.pytree import Code, Knot, Leaf, TracedMatrix, field_names, outline, rebuild
from symphys.types import Expr

Structure = tuple[int, tuple[int, ...]]
"""The number of a tree's structure, and the slots that its entries lie in, in order."""
MOST_KEPT = 300_000
"""Branches that are kept: more would take memory for what no call takes again."""


class Numbers:
    """Numbers of structures.

    Attributes:
        passing: those of trees that may change, so that what is known of one of them is not kept.
    """

    def __init__(self) -> None:
        """None yet."""
        self._numbers: dict[Hashable, int] = {}
        self.passing: set[int] = set()

    def of(self, key: Hashable) -> int:
        """The number of what equals ``key``."""
        return self._numbers.setdefault(key, len(self._numbers))


class Structures:
    """The structures of trees, and the branches that have been looked at."""

    def __init__(self, numbers: Numbers, codes: Callable[[Expr], tuple[Code, ...]], sizes: Sequence[int]) -> None:
        """``codes`` of an expression's entries; ``sizes`` of the slots."""
        self._number, self._passing = numbers.of, numbers.passing
        self._codes, self._sizes = codes, sizes
        self._branches: dict[int, tuple[Any, Structure]] = {}

    def of(self, tree: Any) -> Structure:
        """Of a tree."""
        kind: Any = type(tree)
        if kind is TracedMatrix:
            if tree.kept is None:
                tree.kept = self._leaf(tree.leaf, tree.codes)
            return tree.kept  # type: ignore[no-any-return]
        if (known := self._branches.get(id(tree))) is not None:
            return known[1]
        if kind is tuple or kind is list:
            return self._fork(kind, (), [self.of(part) for part in tree])
        if kind is dict:
            return self._fork(kind, tuple(tree), [self.of(part) for part in tree.values()])
        if isinstance(tree, ca.SX | ca.DM):
            matrix = tree if kind is ca.SX else ca.SX(tree)
            return self._leaf(outline(matrix), self._codes(matrix))
        names = field_names(kind)
        if names is None:
            return self._number((kind, tree)), ()
        found = self._fork(kind, (), [self.of(getattr(tree, name)) for name in names])
        if found[0] not in self._passing:
            self.keep(tree, found)
        return found

    def of_call(self, arguments: tuple[Any, ...], named: dict[str, Any]) -> Structure:
        """Of the arguments of a call."""
        return self.of((*arguments, named) if named else arguments)

    def keep(self, tree: Any, structure: Structure) -> None:
        """Remember the structure of a tree that stays as it is."""
        if len(self._branches) >= MOST_KEPT:
            self._branches.clear()
        self._branches[id(tree)] = tree, structure

    def _leaf(self, leaf: Leaf, codes: Sequence[Code]) -> Structure:
        slots: dict[int, int] = {}
        own = tuple([c if isinstance(c, float) else (slots.setdefault(c[0], len(slots)), c[1]) for c in codes])
        return self._number((leaf, own, tuple([self._sizes[slot] for slot in slots]))), tuple(slots)

    def _fork(self, kind: type, keys: tuple[Hashable, ...], parts: Sequence[Structure]) -> Structure:
        """Of parts side by side. Lists and dicts may change, so that what has one is not kept."""
        slots: dict[int, int] = {}
        pattern = tuple([slots.setdefault(slot, len(slots)) for _, own in parts for slot in own])
        numbers = tuple([number for number, _ in parts])
        number = self._number((kind, keys, numbers, pattern))
        if kind is list or kind is dict or not self._passing.isdisjoint(numbers):
            self._passing.add(number)
        return number, tuple(slots)


class Blueprint:
    """How trees of one shape are put together from their matrices; parts without any are made once."""

    def __init__(self, shape: Any) -> None:
        """``shape``: see ``dismantle``."""
        self._shape = _with_still_parts(shape)
        self._structures: tuple[tuple[int, tuple[int, ...]], ...] | None = None

    def tree(self, leaves: Iterator[Expr], slots: Sequence[int], structures: Structures) -> Any:
        """A tree, and its dataclasses known to ``structures``; ``slots`` are those that the leaves lie in."""
        nodes: list[Any] = []
        tree = _assembled(self._shape, leaves, nodes)
        if nodes and len(set(slots)) == len(slots):
            if self._structures is None:
                places = {slot: k for k, slot in enumerate(slots)}
                found = [structures.of(node) for node in nodes]
                self._structures = tuple((number, tuple([places[slot] for slot in own])) for number, own in found)
            else:
                for node, (number, own) in zip(nodes, self._structures, strict=True):
                    structures.keep(node, (number, tuple([slots[k] for k in own])))
        return tree


class _Still:
    """A part without matrices."""

    __slots__ = ("value",)

    def __init__(self, value: Any) -> None:
        self.value = value


def _with_still_parts(shape: Any) -> Any:
    if type(shape) is Leaf:
        return shape
    below = tuple(map(_with_still_parts, shape.below))
    whole = Knot(shape.kind, shape.keys, below)
    if shape.kind is not list and shape.kind is not dict and all(type(part) is _Still for part in below):
        return _Still(rebuild(shape, iter(())))
    return whole


def _assembled(shape: Any, leaves: Iterator[Expr], nodes: list[Any]) -> Any:
    """The tree of this shape; its dataclasses are appended to ``nodes``, inner ones first."""
    kind = type(shape)
    if kind is Leaf:
        return next(leaves)
    if kind is _Still:
        return shape.value
    parts = [_assembled(part, leaves, nodes) for part in shape.below]
    if shape.kind is tuple or shape.kind is list:
        return shape.kind(parts)
    if shape.kind is dict:
        return dict(zip(shape.keys, parts, strict=True))
    tree = shape.kind(*parts)
    nodes.append(tree)
    return tree
