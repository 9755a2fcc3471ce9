"""A step as a list of calls of small functions, instead of one expression.

The results of a call are fresh symbols, so that later calls depend on these and not on how they were computed. Calls
for equal bodies, pairs and sweeps are of equal functions, which a compiler then compiles once. Equal calls with equal
arguments are recorded once. Dead-code elimination then drops calls whose results no later call uses, and the entries of
results that none uses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import casadi as ca

from symphys.dynamics.tracing.pytree import TracedMatrix, flatten, outline, unflatten
from symphys.dynamics.tracing.trace import Tracer
from symphys.types import Expr

T = TypeVar("T")


class TracedVector(NamedTuple):
    """Contiguous numbers: a named part of the state, an argument of the step, or a result of a call.

    Attributes:
        name: of an argument, or of a part of the next state; "" for a result of a call.
        size: how many.
        number: distinguishes them; the slot of the codes in ``pytree``.
    """

    name: str
    size: int
    number: int


class TracedCall(NamedTuple):
    """A call of an SX function of vectors, which returns vectors; see ``guards`` for when it may be left out."""

    function: ca.Function
    inputs: tuple[TracedVector, ...]
    outputs: tuple[TracedVector, ...]
    guard: Any = None
    section: Any = None


MAX_ALIKE_FUNCTIONS = 2
"""Functions for calls of a shared one that differ in no more than where their arguments lie; others take copies."""


class Recorder(Tracer):
    """Records the calls of a step.

    Attributes:
        calls: in their order.
        guards, sections: the words that ``guards`` reads.
        named: the slots of the arguments.
    """

    def __init__(self) -> None:
        """Start without calls."""
        super().__init__()
        self.calls: list[TracedCall] = []
        self.guards: list[TracedVector] = []
        self.sections: list[tuple[TracedVector, int]] = []
        self.named: dict[str, int] = {}
        self._slots: list[TracedVector] = []
        self._adopted: list[Expr] = []
        self._outputs: dict[int, tuple[ca.Function, tuple[int, ...]]] = {}
        self._copied: dict[tuple[Callable[..., Any], int], bool] = {}
        self._alike_calls: dict[Any, set[int]] = {}
        self._copies: dict[int, tuple[Any, Any]] = {}
        self._given: dict[tuple[int, tuple[int, ...]], Sequence[int]] = {}

    def argument(self, name: str, symbols: Expr) -> None:
        """Add a slot for an argument of the step."""
        self.named[name] = self.take(symbols)
        self._slots.append(TracedVector(name, symbols.numel(), self.named[name]))

    def guard(self, word: Any) -> None:
        """Implement ``decorator.guard``; a constant guards nothing."""
        (code,) = word.codes if isinstance(word, TracedMatrix) else self._codes(word)
        if not isinstance(code, float):
            self.guards.append(self._slots[code[0]])

    def section(self, word: Any) -> None:
        """Implement ``decorator.section``."""
        (code,) = word.codes if isinstance(word, TracedMatrix) else self._codes(word)
        if not isinstance(code, float):
            self.sections.append((self._slots[code[0]], code[1]))

    def share(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, ...]:
        """Implement ``Tracer.share``."""
        number, _ = self._structures.of(arguments)
        copied = self._copied.get((function, number))
        if copied is None:
            copied = self._copied[function, number] = self._takes_copies(function, number, arguments)
        return tuple(map(self._gathered, arguments)) if copied else arguments

    def _takes_copies(self, function: Callable[..., Any], number: int, arguments: tuple[Any, ...]) -> bool:
        """Whether there were enough calls that differ from this one in no more than where their arguments lie."""
        leaves: list[Expr] = []
        shape = flatten(arguments, leaves)
        constants = tuple(tuple(c if isinstance(c, float) else None for c in self._codes_of(leaf)) for leaf in leaves)
        alike = self._alike_calls.setdefault((function, shape, constants), set())
        if len(alike) >= MAX_ALIKE_FUNCTIONS:
            return True
        alike.add(number)
        return False

    def _gathered(self, tree: Any) -> Any:
        """Return a tree whose parts fill slots of their own, copied once unless it lies so."""
        if type(tree) is tuple:
            return tuple(map(self._gathered, tree))
        known = self._copies.get(id(tree))
        if known is None:
            known = self._copies[id(tree)] = tree, tree if self._fills_slots(tree) else self.contiguous(tree)
        return known[1]

    def _fills_slots(self, tree: Any) -> bool:
        """Whether each part of a tree fills a slot of its own."""
        slots = set[int]()
        columns: Any = self._laid_out(tree).columns(constants=False).values()
        for slot, column in ((column[0][0], column) for column in columns if column):
            if slot in slots or column != [(slot, k) for k in range(self._sizes[slot])]:
                return False
            slots.add(slot)
        return True

    def give(self, name: str, values: Sequence[Expr]) -> TracedVector:
        """Record a call that puts values side by side."""
        stacked = self.call(_side_by_side, (tuple(values),), {})
        slots: dict[int, int] = {}
        codes = [(slots.setdefault(c[0], len(slots)), c[1]) if isinstance(c, tuple) else c for c in stacked.codes]
        symbols = [ca.SX.sym("a", self._slots[k].size) for k in slots]
        entries = [ca.SX(c) if isinstance(c, float) else symbols[c[0]][c[1]] for c in codes]
        function = self._cache.shared(ca.Function("piece", symbols, [ca.vertcat(*entries)]))
        (given,) = self._add(name, function, list(slots))
        return self._slots[given]

    def repeat(self, count: int, once: Callable[[Any, T], T], context: Any, state: T) -> T:
        """Implement ``Tracer.repeat``; once a round repeats itself its calls are copied."""
        before, template = state, list[TracedCall]()
        for _ in range(count):
            slots = self._alike(before, state) if template else None
            if slots is not None:
                before, state = state, self._copy(template, slots, state)
                template = self.calls[-len(template) :]
            else:
                first = len(self.calls)
                before, state = state, once(context, state)
                template = self.calls[first:]
        return state

    def _adopt(self, column: Expr) -> None:
        homes = {symbol.element_hash(): self._homes[symbol.element_hash()][0] for symbol in ca.symvar(column)}
        slots = list(dict.fromkeys(homes.values()))
        symbols = [self._column(slot) for slot in slots]
        (given,) = self._add("", self._cache.shared(ca.Function("piece", symbols, [column])), slots)
        self._adopted.append(column)
        self._homes |= {entry.element_hash(): (given, k) for k, entry in enumerate(column.nonzeros())}

    def _apply(self, function: ca.Function, slots: Sequence[int]) -> Sequence[int]:
        key = id(function), tuple(slots)
        given = self._given.get(key)
        if given is None:
            given = self._given[key] = self._add("", function, slots)
        return given

    def _alike(self, before: Any, after: Any) -> dict[int, int] | None:
        """Map the slots of ``before`` to those of ``after``; None if their layouts differ."""
        (old, old_slots), (new, new_slots) = map(self._structures.of, (before, after))
        return dict(zip(old_slots, new_slots, strict=True)) if old == new else None

    def _copy(self, template: list[TracedCall], slots: dict[int, int], after: T) -> T:
        """Return the state one time later: as ``template`` led to ``after``, its copy leads on from there."""
        for call in template:
            inputs = [slots.get(slot.number, slot.number) for slot in call.inputs]
            given = self._add("", call.function, inputs)
            slots |= dict(zip((slot.number for slot in call.outputs), given, strict=True))
        leaves: list[Expr] = []
        shape = flatten(after, leaves)
        renamed: T = unflatten(shape, (self._renamed(leaf, slots) for leaf in leaves))
        return renamed

    def _renamed(self, leaf: Expr, slots: dict[int, int]) -> TracedMatrix:
        codes = leaf.codes if isinstance(leaf, TracedMatrix) else self._codes(leaf)
        new = [c if isinstance(c, float) else (slots.get(c[0], c[0]), c[1]) for c in codes]
        return TracedMatrix(leaf.leaf if isinstance(leaf, TracedMatrix) else outline(leaf), tuple(new))

    def _add(self, name: str, function: ca.Function, slots: Sequence[int]) -> Sequence[int]:
        first, own = len(self._slots), self._slots
        for size in self._results(function):
            own.append(TracedVector(name, size, self._slot(size)))
        self.calls.append(TracedCall(function, tuple([own[k] for k in slots]), tuple(own[first:])))
        return range(first, len(own))

    def _results(self, function: ca.Function) -> tuple[int, ...]:
        """Return the sizes of what a function gives."""
        known = self._outputs.get(id(function))
        if known is None or known[0] is not function:
            known = self._outputs[id(function)] = function, tuple(map(function.numel_out, range(function.n_out())))
        return known[1]


def _side_by_side(values: tuple[Expr, ...]) -> Expr:
    return ca.vertcat(*(ca.densify(ca.vec(value)) for value in values))


Words = int
"""Places in a slot, as bits."""


def without_dead_code(calls: Sequence[TracedCall]) -> tuple[TracedCall, ...]:
    """Return the calls with the same named results; other vectors hold only the entries that are used."""
    return _Trimming(calls).calls()


class _Trimming:
    """The entries of each vector that are used, and the functions that are left."""

    def __init__(self, calls: Sequence[TracedCall]) -> None:
        self._calls = calls
        self._used: dict[int, Words] = {}
        self._needs: dict[tuple[int, tuple[Words, ...]], tuple[Words, ...]] = {}
        self._functions: dict[Any, ca.Function] = {}
        self._vectors: dict[int, TracedVector] = {}
        self._needed_by_call: list[tuple[Words, ...]] = []
        used = self._used
        for call in reversed(calls):
            for slot in call.outputs:
                used[slot.number] = (1 << slot.size) - 1 if slot.name else used.get(slot.number, 0)
            needed = self._needed(call, tuple([used[slot.number] for slot in call.outputs]))
            for slot, words in zip(call.inputs, needed, strict=True):
                used[slot.number] = used.get(slot.number, 0) | words
            self._needed_by_call.append(needed)
        for slot in (slot for call in calls for slot in call.inputs if slot.name):
            used[slot.number] = (1 << slot.size) - 1

    def calls(self) -> tuple[TracedCall, ...]:
        """Return the calls of which some result is read."""
        found, used = list[TracedCall](), self._used
        for call, needed in zip(self._calls, reversed(self._needed_by_call), strict=True):
            given = tuple([used[slot.number] for slot in call.outputs])
            if any(given):
                found.append(self._trimmed(call, needed, given))
        return tuple(found)

    def _needed(self, call: TracedCall, kept: tuple[Words, ...]) -> tuple[Words, ...]:
        """Return the words of its inputs that a call needs for what is read of it."""
        key = id(call.function), kept
        if key not in self._needs:
            symbols: list[Expr] = [ca.SX.sym("a", slot.size) for slot in call.inputs]
            found = _symbols_of(_results(call.function, symbols, kept))
            self._needs[key] = tuple(
                sum(1 << k for k, entry in enumerate(column.nonzeros()) if entry.element_hash() in found)
                for column in symbols
            )
        return self._needs[key]

    def _trimmed(self, call: TracedCall, needed: Sequence[Words], given: tuple[Words, ...]) -> TracedCall:
        closer, known = self._closer, self._vectors
        inputs = [
            known.get(slot.number) or closer(slot) for slot, words in zip(call.inputs, needed, strict=True) if words
        ]
        outputs = [closer(slot) for slot, words in zip(call.outputs, given, strict=True) if words]
        return TracedCall(self._function(call, needed, given), tuple(inputs), tuple(outputs))

    def _closer(self, slot: TracedVector) -> TracedVector:
        found = self._vectors.get(slot.number)
        if found is None:
            size = self._used[slot.number].bit_count()
            found = slot if slot.name or size == slot.size else TracedVector(slot.name, size, slot.number)
            self._vectors[slot.number] = found
        return found

    def _function(self, call: TracedCall, needs: Sequence[Words], given: tuple[Words, ...]) -> ca.Function:
        """Return the function from what is kept of the inputs to what is kept of the outputs."""
        used = self._used
        kept = tuple([used[slot.number] for slot in call.inputs])
        key = id(call.function), kept, given
        if key not in self._functions:
            symbols, columns = [], []
            for slot, words, needed in zip(call.inputs, kept, needs, strict=True):
                column = ca.SX(slot.size, 1)
                if needed:
                    symbols.append(ca.SX.sym("a", words.bit_count()))
                    column[_places(words)] = symbols[-1]
                columns.append(ca.densify(column))
            results = [result for result in _results(call.function, columns, given) if result.numel()]
            self._functions[key] = ca.Function("piece", symbols, results)
        return self._functions[key]


def _places(words: Words) -> list[int]:
    return [k for k in range(words.bit_length()) if words >> k & 1]


def _symbols_of(columns: list[Expr]) -> set[int]:
    symbols: list[Expr] = ca.symvar(ca.vertcat(ca.SX(0, 1), *columns))
    return {symbol.element_hash() for symbol in symbols}


def _results(function: ca.Function, arguments: Sequence[Expr], kept: Sequence[Words]) -> list[Expr]:
    """Return the words that are kept of what a function gives."""
    results = function.call(list(arguments), True, False)
    return [ca.densify(result)[_places(words)] for result, words in zip(results, kept, strict=True)]
