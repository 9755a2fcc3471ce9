"""A step as a list of small functions instead of one expression: where the step says ``keep``, a piece ends.

What is kept becomes fresh symbols, so that what follows depends on these and not on how they came about. Pieces of
equal bodies, pairs and sweeps are equal functions, which a compiler then sees once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar

import casadi as ca

T = TypeVar("T")
Keep = Callable[[Any], Any]
"""Takes a tree (dataclasses, lists, tuples, dicts) of expressions, gives the same tree."""
Repeat = Callable[[int, Callable[[Any], Any], Any], Any]
"""(count, once, state) -> the state after ``count`` times ``once``."""
Expr = Any
"""casadi SX"""


def whole(tree: T) -> T:
    """Keeps nothing: the step stays one expression."""
    return tree


def over_again(count: int, once: Callable[[T], T], state: T) -> T:
    """``once`` applied ``count`` times."""
    for _ in range(count):
        state = once(state)
    return state


@dataclass(frozen=True)
class Slot:
    """Numbers that lie side by side: a named part of the state or an argument of the step, or what a piece gave.

    Attributes:
        name: of an argument, or of a part of the next state; "" for what a piece gave.
        size: how many.
        number: tells slots apart.
    """

    name: str
    size: int
    number: int


@dataclass(frozen=True)
class Piece:
    """An SX function from slots to one slot."""

    function: ca.Function
    inputs: tuple[Slot, ...]
    output: Slot


class Recorder:
    """Collects the pieces of a step. Equal pieces share one function."""

    def __init__(self) -> None:
        """Nothing yet."""
        self.pieces: list[Piece] = []
        self._home: dict[int, tuple[Slot, int]] = {}
        self._symbols: dict[Slot, Expr] = {}
        self._functions: dict[str, ca.Function] = {}

    def argument(self, name: str, size: int) -> Expr:
        """Symbols for an argument of the step."""
        return self._symbols[self.take(name, ca.SX.sym("kept", size))]

    def take(self, name: str, symbols: Expr) -> Slot:
        """A slot for symbols: of an argument, or of what a piece gives."""
        slot = Slot(name, symbols.numel(), len(self._symbols))
        self._symbols[slot] = symbols
        for place in range(slot.size):
            self._home[symbols[place].element_hash()] = slot, place
        return slot

    def keep(self, tree: T) -> T:
        """The tree with what is computed in it replaced by symbols; a piece computes those."""
        found: dict[int, Expr] = {}
        for leaf in leaves(tree):
            for number in leaf.nonzeros():
                if computed(number):
                    found.setdefault(number.element_hash(), number)
        if not found:
            return tree
        slot = self.give("", ca.vertcat(*found.values()))
        return renamed(tree, dict(zip(found, ca.vertsplit(self._symbols[slot]), strict=True)))

    def give(self, name: str, values: Expr) -> Slot:
        """A piece that computes ``values`` (a column)."""
        inputs = tuple(dict.fromkeys(self._home[symbol.element_hash()][0] for symbol in ca.symvar(values)))
        function = ca.Function("piece", [self._symbols[each] for each in inputs], [ca.densify(values)])
        function = self._functions.setdefault(function.serialize(), function)
        return self._add(name, function, inputs)

    def repeat(self, count: int, once: Callable[[T], T], state: T) -> T:
        """``once`` applied ``count`` times; as soon as it repeats itself its pieces are copied."""
        before, template = state, list[Piece]()
        for _ in range(count):
            slots = self._alike(before, state)
            if template and slots is not None:
                before, state = state, self._copy(template, slots, before, state)
                template = self.pieces[-len(template) :]
            else:
                first = len(self.pieces)
                before, state = state, once(state)
                template = self.pieces[first:]
        return state

    def _alike(self, before: Any, after: Any) -> dict[Slot, Slot] | None:
        """Which slot of ``after`` stands where one of ``before`` stood; None if they do not lie alike."""
        old, new = hashes(before), hashes(after)
        slots: dict[Slot, Slot] = {}
        for a, b in zip(old, new, strict=False):
            (was, place), (now, there) = self._home[a], self._home[b]
            if place != there or was.size != now.size or slots.setdefault(was, now) != now:
                return None
        return slots if len(old) == len(new) else None

    def _copy(self, template: list[Piece], slots: dict[Slot, Slot], before: T, after: T) -> T:
        """The state one time later: as ``template`` led from before to after, its copy leads from after on."""
        symbols: dict[int, Expr] = {}
        for piece in template:
            new = self._add("", piece.function, tuple(slots.get(slot, slot) for slot in piece.inputs))
            slots[piece.output] = new
            for place in range(new.size):
                symbols[self._symbols[piece.output][place].element_hash()] = self._symbols[new][place]
        older = dict(zip(hashes(before), numbers(after), strict=True))
        return renamed(after, older | symbols)

    def _add(self, name: str, function: ca.Function, inputs: tuple[Slot, ...]) -> Slot:
        slot = self.take(name, ca.SX.sym("kept", function.numel_out(0)))
        self.pieces.append(Piece(function, inputs, slot))
        return slot


def computed(number: Expr) -> bool:
    """Whether an SX scalar is neither a constant nor a symbol."""
    return not number.is_constant() and not number.is_symbolic()


def renamed(tree: T, symbols: Mapping[int, Expr]) -> T:
    """The tree with its numbers replaced by symbols, where there are some for them."""

    def change(leaf: Expr) -> Expr:
        new = [symbols.get(number.element_hash(), number) for number in leaf.nonzeros()]
        return ca.SX(leaf.sparsity(), ca.vertcat(*new))

    changed: T = mapped(tree, change)
    return changed


def numbers(tree: Any) -> list[Expr]:
    """The symbols of a tree that has been kept, in order."""
    return [number for leaf in leaves(tree) for number in leaf.nonzeros() if number.is_symbolic()]


def hashes(tree: Any) -> list[int]:
    """What tells those apart."""
    return [number.element_hash() for number in numbers(tree)]


def leaves(tree: Any) -> Iterator[Expr]:
    """The SX matrices of a tree."""
    if isinstance(tree, ca.SX):
        yield tree
    else:
        for _, part in parts(tree):
            yield from leaves(part)


def mapped(tree: Any, change: Callable[[Expr], Expr]) -> Any:
    """The tree with its SX matrices changed."""
    if isinstance(tree, ca.SX):
        return change(tree)
    new = [(key, mapped(part, change)) for key, part in parts(tree)]
    if isinstance(tree, list | tuple):
        return type(tree)(part for _, part in new)
    if isinstance(tree, dict):
        return dict(new)
    return replace(tree, **dict(new)) if new else tree


def parts(tree: Any) -> list[tuple[Any, Any]]:
    """What a tree consists of: nothing for what is no dataclass, list, tuple or dict."""
    if isinstance(tree, list | tuple):
        return list(enumerate(tree))
    if isinstance(tree, dict):
        return list(tree.items())
    if is_dataclass(tree) and not isinstance(tree, type):
        return [(field.name, getattr(tree, field.name)) for field in fields(tree)]
    return []
