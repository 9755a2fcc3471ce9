"""The calls of a step as functions that are built once: equal calls of equal structure share one casadi function.

That holds for all steps that a process traces: the next use of a problem, or the next problem of its kind, builds what
is new to it.

The first time a traced function is called with arguments of some structure it is called with symbols in place of all
that varies, and its result becomes a casadi function. From then on that function is called: by ``InlineTracer`` within
one expression, by a ``Recorder`` as a call of its own. Entries that are constants stay constants, so that
structural zeros cost nothing.

Results lie in slots, columns of numbers; members of a tuple that are trees themselves have slots of their own, so that
later calls have the same structure for each of them. Between calls a tree's matrices are ``TracedMatrix``, which store
where their entries lie.

The structure of a tree is a number, so that a call finds what was built for arguments of the same structure. Two trees
have the same number if they have the same shape, the same constants, and entries at the same places of slots of the
same sizes, where equal slots stand for equal slots. Trees share most of their branches with trees that were looked at
before, so a dataclass is looked at once: what a call returns has the numbers of its template.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator, Sequence
from itertools import count, repeat
from typing import Any, NamedTuple, TypeVar

import casadi as ca

from symphys.dynamics.tracing.decorator import tracing
from symphys.dynamics.tracing.pytree import (
    SCALAR,
    Code,
    Leaf,
    TracedMatrix,
    TreeDef,
    field_names,
    flatten,
    leaves_of,
    matrix,
    outline,
    slots_of,
    unflatten,
)
from symphys.maths.verbatim import verbatim
from symphys.records import dataclass
from symphys.types import Expr

Structure = tuple[int, tuple[int, ...]]
"""The number of a tree's structure, and the slots that its entries lie in, in order."""
MAX_KEPT_BRANCHES = 300_000
"""Branches that are kept: more would take memory for what no call takes again."""


class Numbers:
    """Numbers of structures.

    Attributes:
        passing: those of trees that may change, so that what is known of one of them is not kept.
    """

    def __init__(self) -> None:
        """Start without templates."""
        self._numbers: dict[Hashable, int] = {}
        self.passing: set[int] = set()

    def of(self, key: Hashable) -> int:
        """Return the number of what equals ``key``."""
        return self._numbers.setdefault(key, len(self._numbers))


class Structures:
    """The structures of trees, and the branches that have been looked at."""

    def __init__(self, numbers: Numbers, codes: Callable[[Expr], tuple[Code, ...]], sizes: Sequence[int]) -> None:
        """Start without structures; ``codes`` of an expression's entries; ``sizes`` of the slots."""
        self._number, self._passing = numbers.of, numbers.passing
        self._codes, self._sizes = codes, sizes
        self._branches: dict[int, tuple[Any, Structure]] = {}

    def of(self, tree: Any) -> Structure:
        """Return the number of a tree's structure."""
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
        """Return the key of the arguments of a call."""
        return self.of((*arguments, named) if named else arguments)

    def keep(self, tree: Any, structure: Structure) -> None:
        """Remember the structure of a tree that stays as it is."""
        if len(self._branches) >= MAX_KEPT_BRANCHES:
            self._branches.clear()
        self._branches[id(tree)] = tree, structure

    def _leaf(self, leaf: Leaf, codes: Sequence[Code]) -> Structure:
        slots: dict[int, int] = {}
        own = tuple([c if isinstance(c, float) else (slots.setdefault(c[0], len(slots)), c[1]) for c in codes])
        return self._number((leaf, own, tuple([self._sizes[slot] for slot in slots]))), tuple(slots)

    def _fork(self, kind: type, keys: tuple[Hashable, ...], parts: Sequence[Structure]) -> Structure:
        """Number the structures of parts side by side; those with lists or dicts, which may change, are not cached."""
        slots: dict[int, int] = {}
        pattern = tuple([slots.setdefault(slot, len(slots)) for _, own in parts for slot in own])
        numbers = tuple([number for number, _ in parts])
        number = self._number((kind, keys, numbers, pattern))
        if kind is list or kind is dict or not self._passing.isdisjoint(numbers):
            self._passing.add(number)
        return number, tuple(slots)


class Blueprint:
    """Rebuilds trees of one shape from their matrices; parts without any are made once."""

    def __init__(self, shape: Any) -> None:
        """Prepare a shape, see ``flatten``."""
        self._shape = _with_constant_parts(shape)
        self._structures: tuple[tuple[int, tuple[int, ...]], ...] | None = None

    def tree(self, leaves: Iterator[Expr], slots: Sequence[int], structures: Structures) -> Any:
        """Return a tree, and its dataclasses known to ``structures``; ``slots`` are those that the leaves lie in."""
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


class _ConstantPart:
    """A part without matrices."""

    __slots__ = ("value",)

    def __init__(self, value: Any) -> None:
        self.value = value


def _with_constant_parts(shape: Any) -> Any:
    if type(shape) is Leaf:
        return shape
    below = tuple(map(_with_constant_parts, shape.below))
    whole = TreeDef(shape.kind, shape.keys, below)
    if shape.kind is not list and shape.kind is not dict and all(type(part) is _ConstantPart for part in below):
        return _ConstantPart(unflatten(shape, iter(())))
    return whole


def _assembled(shape: Any, leaves: Iterator[Expr], nodes: list[Any]) -> Any:
    """Return the tree of this shape; its dataclasses are appended to ``nodes``, inner ones first."""
    kind = type(shape)
    if kind is Leaf:
        return next(leaves)
    if kind is _ConstantPart:
        return shape.value
    parts = [_assembled(part, leaves, nodes) for part in shape.below]
    if shape.kind is tuple or shape.kind is list:
        return shape.kind(parts)
    if shape.kind is dict:
        return dict(zip(shape.keys, parts, strict=True))
    tree = shape.kind(*parts)
    nodes.append(tree)
    return tree


T = TypeVar("T")


@dataclass(frozen=True)
class Template:
    """A traced function for arguments of one structure, as a casadi function.

    Attributes:
        function: of the slots in ``used``, returns columns of what has to be computed; None if that is nothing.
        used: which of the slots that the arguments lie in.
        blueprint: of the tree that it returns.
        matrices: of that tree, in order. A code's slot is one of those that the arguments lie in, or -1, -2 .. for the
            first, the second .. that the function returns.
    """

    function: ca.Function | None
    used: tuple[int, ...]
    blueprint: Blueprint
    matrices: tuple[tuple[Leaf, tuple[Code, ...]], ...]


class TraceCache:
    """A cache of templates for all tracers of this process: one problem's step is traced for several uses.

    Attributes:
        numbers: of the structures of arguments.
        templates: by function, structure and whether it is reduced.
    """

    def __init__(self) -> None:
        """Start without calls."""
        self.numbers = Numbers()
        self.templates: dict[Hashable, Template] = {}
        self._functions: dict[str, ca.Function] = {}

    def shared(self, function: ca.Function) -> ca.Function:
        """Return a function, or an equal one that was there before."""
        return self._functions.setdefault(function.serialize(), function)


MAX_TEMPLATES = 10_000
"""Templates that are kept for the next tracer, some 90 MB."""
_CACHE = TraceCache()


def _trace_cache() -> TraceCache:
    """Return the templates for the next tracer."""
    global _CACHE
    if len(_CACHE.templates) > MAX_TEMPLATES:
        _CACHE = TraceCache()
    return _CACHE


class _LaidOut(NamedTuple):
    """A tree: its shape, and the part, the outline and the codes of each of its matrices."""

    shape: Any
    matrices: list[tuple[int, Leaf, tuple[Code, ...]]]

    def columns(self, constants: bool) -> dict[int, list[Code]]:
        """Return the codes of each part, without ``constants`` unless they are asked for."""
        found: dict[int, list[Code]] = {}
        for part, _, codes in self.matrices:
            found.setdefault(part, []).extend(code for code in codes if constants or not isinstance(code, float))
        return found


class Tracer(ABC):
    """Calls traced functions; see ``decorator``."""

    def __init__(self, reduces: bool = True) -> None:
        """Start without slots; ``reduces``: eliminate common subexpressions, up to half of the building time.

        Where that was done for another tracer, this one has it too.
        """
        self._reduces = reduces
        self._columns: list[Expr | None] = []
        self._entries: list[list[Expr]] = []
        self._sizes: list[int] = []
        self._homes: dict[int, tuple[int, int]] = {}
        self._cache = _trace_cache()
        self._structures = Structures(self._cache.numbers, self._codes, self._sizes)

    def repeat(self, count: int, once: Callable[[Any, T], T], context: Any, state: T) -> T:
        """Repeat ``state = once(context, state)`` ``count`` times."""
        for _ in range(count):
            state = once(context, state)
        return state

    def guard(self, word: Any) -> None:
        """Ignore a predicate; only a recorder makes guards."""
        del word

    def section(self, word: Any) -> None:
        """Ignore a predicate; only a recorder makes sections."""
        del word

    def share(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return the arguments unchanged; only a recorder copies any."""
        del function
        return arguments

    def _codes_of(self, leaf: Expr) -> tuple[Code, ...]:
        return leaf.codes if isinstance(leaf, TracedMatrix) else self._codes(leaf)

    def _laid_out(self, tree: Any) -> _LaidOut:
        leaves: list[Expr] = []
        shape = flatten(tree, leaves)
        matrices = [
            (part, leaf.leaf if isinstance(leaf, TracedMatrix) else outline(leaf), self._codes_of(leaf))
            for part, leaf in zip(slots_of(shape), leaves, strict=True)
        ]
        return _LaidOut(shape, matrices)

    def contiguous(self, tree: T, constants: bool = False) -> T:
        """Return the tree with each of its parts in a slot of its own; ``constants``: these too."""
        laid_out = self._laid_out(tree)
        columns = {part: column for part, column in laid_out.columns(constants).items() if column}
        if not columns:
            return tree
        used: dict[int, int] = {}
        for code in (code for column in columns.values() for code in column):
            if not isinstance(code, float):
                used.setdefault(code[0], len(used))
        symbols = [ca.SX.sym("a", self._sizes[slot]) for slot in used]
        results = [
            ca.vertcat(*(ca.SX(c) if isinstance(c, float) else symbols[used[c[0]]][c[1]] for c in column))
            for column in columns.values()
        ]
        new = self._apply(self._cache.shared(ca.Function("piece", symbols, results)), list(used))
        places = {part: zip(repeat(slot), count(), strict=False) for part, slot in zip(columns, new, strict=True)}
        found = []
        for part, leaf, codes in laid_out.matrices:
            moved = (c if isinstance(c, float) and not constants else next(places[part]) for c in codes)
            found.append(TracedMatrix(leaf, tuple(moved)))
        together: T = unflatten(laid_out.shape, iter(found))
        return together

    @abstractmethod
    def _apply(self, function: ca.Function, slots: Sequence[int]) -> Sequence[int]:
        """Return the slots that take what the function gives."""

    @abstractmethod
    def _adopt(self, column: Expr) -> None:
        """Find a home for expressions that come from no part, such as a mass that follows from a radius."""

    def take(self, column: Expr) -> int:
        """Return a slot for a column of symbols or expressions."""
        number = self._slot(column.numel())
        self._hold(number, column)
        return number

    def _slot(self, size: int) -> int:
        """Return a slot of that size, as yet without expressions."""
        self._columns.append(None)
        self._entries.append([])
        self._sizes.append(size)
        return len(self._sizes) - 1

    def _hold(self, number: int, column: Expr) -> None:
        self._columns[number], self._entries[number] = column, column.nonzeros()
        for place, entry in enumerate(self._entries[number]):
            self._homes.setdefault(entry.element_hash(), (number, place))

    def _column(self, number: int) -> Expr:
        """Return the symbols of a slot, which are made when a result of a call is first read."""
        if self._columns[number] is None:
            self._hold(number, ca.SX.sym("kept", self._sizes[number]))
        return self._columns[number]

    def _entry(self, code: tuple[int, int]) -> Expr:
        self._column(code[0])
        return self._entries[code[0]][code[1]]

    def value(self, leaf: Expr) -> Expr:
        """Return a leaf of a tree as an expression."""
        if not isinstance(leaf, TracedMatrix):
            return leaf
        entries = [ca.SX(c) if isinstance(c, float) else self._entry(c) for c in leaf.codes]
        return matrix(leaf.leaf, entries)

    def call(self, function: Callable[..., T], arguments: tuple[Any, ...], named: dict[str, Any]) -> T:
        """Call ``function(*arguments, **named)``."""
        number, slots = self._structures.of_call(arguments, named)
        known = self._cache.templates
        template = known.get((function, number, True)) or known.get((function, number, self._reduces))
        if template is None:
            template = known[function, number, self._reduces] = self._build(function, arguments, named, slots)
        tree: T = self._fill(template, slots)
        return tree

    def _codes(self, expression: Expr) -> tuple[Code, ...]:
        """Return the slots of the entries of an expression; entries without one get a slot."""
        entries = expression.nonzeros()
        fresh = [e for e in entries if not e.is_constant() and e.element_hash() not in self._homes]
        if fresh:
            self._adopt(ca.vertcat(*fresh))
        return tuple(float(e) if e.is_constant() else self._homes[e.element_hash()] for e in entries)

    def _build(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any], slots: Sequence[int]
    ) -> Template:
        """Return the template of a function for arguments of this structure."""
        leaves: list[Expr] = []
        shape = flatten((arguments, named), leaves)
        places = {slot: k for k, slot in enumerate(slots)}
        codes = (leaf.codes if isinstance(leaf, TracedMatrix) else self._codes(leaf) for leaf in leaves)
        known = [[c if isinstance(c, float) else (places[c[0]], c[1]) for c in each] for each in codes]
        symbols = [ca.SX.sym("a", self._sizes[slot]) for slot in slots]
        entries: list[list[Expr]] = [symbol.nonzeros() for symbol in symbols]
        outlines: list[Leaf] = []
        leaves_of(shape, outlines)
        expressions = (_argument(symbols, entries, *each) for each in zip(outlines, known, strict=True))
        results: list[Expr] = []
        inner, inner_named = unflatten(shape, expressions)
        with tracing(None):
            result_shape = flatten(function(*inner, **inner_named), results)
        given = _Results(entries)
        matrices = given.placed(list(map(self.value, results)), slots_of(result_shape))
        blueprint = Blueprint(result_shape)
        if not given.columns:
            return Template(None, (), blueprint, matrices)
        columns: Any = [ca.vertcat(*column) for column in given.columns.values()]
        if self._reduces:
            columns = ca.cse(columns)
        needed = {symbol.element_hash() for symbol in ca.symvar(ca.vertcat(*columns))}
        used = [k for k, column in enumerate(entries) if any(e.element_hash() in needed for e in column)]
        built = self._cache.shared(ca.Function("piece", [symbols[k] for k in used], columns))
        return Template(built, tuple(used), blueprint, matrices)

    def _fill(self, template: Template, slots: Sequence[int]) -> Any:
        """Return the tree that a template stands for, given the slots that its arguments lie in."""
        if template.function is not None:
            given = self._apply(template.function, [slots[k] for k in template.used])
            slots = (*slots, *reversed(given))
        filled = (TracedMatrix(leaf, codes, slots) for leaf, codes in template.matrices)
        return template.blueprint.tree(filled, slots, self._structures)


def _argument(symbols: Sequence[Expr], entries: Sequence[Sequence[Expr]], leaf: Leaf, codes: Sequence[Code]) -> Expr:
    """Return a matrix of symbols: numbers side by side in one slot in one piece, which is faster than one by one."""
    first, count = codes[0] if codes else 0.0, len(codes)
    if leaf.pattern is None and leaf != SCALAR and not isinstance(first, float):
        slot, start = first
        if all(code == (slot, start + k) for k, code in enumerate(codes)):
            column = symbols[slot][start : start + count]
            return column if leaf.columns == 1 else ca.reshape(column, leaf.rows, leaf.columns)
    return matrix(leaf, [ca.SX(c) if isinstance(c, float) else entries[c[0]][c[1]] for c in codes])


class InlineTracer(Tracer):
    """All calls in one expression."""

    def contiguous(self, tree: T, constants: bool = False) -> T:
        """Return the tree, with its constants as results of a call: their arithmetic is that of a recorder's calls."""
        return super().contiguous(tree, True) if constants else tree

    def _adopt(self, column: Expr) -> None:
        self.take(column)

    def _apply(self, function: ca.Function, slots: Sequence[int]) -> Sequence[int]:
        given = [self._column(slot) for slot in slots]
        with verbatim():  # its numbers are those of a call of its own
            columns = function.call(given)
        found = [self._slot(column.numel()) for column in columns]
        for number, column in zip(found, columns, strict=True):
            self._columns[number], self._entries[number] = column, column.nonzeros()
        return found


class _Results:
    """Results of a traced function, column by column, and the slot of each number."""

    def __init__(self, entries: Sequence[Sequence[Expr]]) -> None:
        """Start without columns; ``entries`` of the arguments' slots need not be returned."""
        self.columns: dict[int, list[Expr]] = {}
        self._homes = {e.element_hash(): (k, j) for k, column in enumerate(entries) for j, e in enumerate(column)}

    def placed(self, matrices: Sequence[Expr], slots: Sequence[int]) -> tuple[tuple[Leaf, tuple[Code, ...]], ...]:
        """Return outlines and codes of matrices, whose numbers go to their slots if they lie nowhere yet.

        The few numbers of a body, such as its velocities, stay together, also those that are left as they were.
        """
        numbers = [matrix.nonzeros() for matrix in matrices]
        by_slot: dict[int, list[list[Expr]]] = {}
        for slot, own in zip(slots, numbers, strict=True):
            by_slot.setdefault(slot, []).append(own)
        anew = {slot: self._together(parts) for slot, parts in by_slot.items()}
        return tuple(
            (outline(matrix), tuple([self._code(number, slot, anew[slot]) for number in own]))
            for matrix, slot, own in zip(matrices, slots, numbers, strict=True)
        )

    def _together(self, parts: Sequence[Sequence[Expr]]) -> bool:
        """Whether all numbers of a slot go there: one or two vectors of space, of which something is new."""
        vectors = len(parts) <= 2 and all(len(part) == 3 for part in parts)
        return vectors and any(self._is_new(number) for part in parts for number in part)

    def _is_new(self, number: Expr) -> bool:
        return not number.is_constant() and number.element_hash() not in self._homes

    def _code(self, number: Expr, slot: int, anew: bool) -> Code:
        if number.is_constant():
            return float(number)
        code = number.element_hash()
        if code not in self._homes or (anew and self._homes[code][0] >= 0):
            column = self.columns.setdefault(slot, [])
            self._homes[code] = (-1 - list(self.columns).index(slot), len(column))
            column.append(number)
        return self._homes[code]
