"""A recorder of steps in which what goes from one body or pair to the next lies in vectors of its own."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, TypeVar

import casadi as ca

from symphys.dynamics.tracing.pytree import TracedMatrix, dismantle, outline, rebuild, slots_of
from symphys.dynamics.tracing.recording import Recorder, TracedVector

T = TypeVar("T")
Expr = Any
"""casadi SX"""


class MemberRecorder(Recorder):
    """Records where chains begin, and which calls hand them on.

    Attributes:
        roots: for the number of a vector with which a chain begins the body whose pairs go along it; None: all members.
        folds: numbers of the results of calls that hand a chain on to the next body.
        sights: numbers of vectors: of each body its position and its reach, then how far what strikes comes.
        words: for the number of the vector of a guard what it is about.
        points: for the same which point of that alone it is about, if it is.
    """

    def __init__(self) -> None:
        """Nothing yet."""
        super().__init__()
        self.roots: dict[int, int | None] = {}
        self.folds: set[int] = set()
        self.words: dict[int, Hashable] = {}
        self.points: dict[int, int] = {}
        self.sights: list[int] = []

    def guard(self, word: Any, of: Hashable, point: int | None, late: bool) -> None:
        """See ``decorator.guard``."""
        guards = self.late_guards if late else self.guards
        known = len(guards)
        super().guard(word, of, point, late)
        for vector in guards[known:]:
            self.words[vector.number] = of
            if point is not None:
                self.points[vector.number] = point

    def call(self, function: Callable[..., T], arguments: tuple[Any, ...], named: dict[str, Any]) -> T:
        """See ``Tracer``."""
        first = len(self.calls)
        tree = super().call(function, arguments, named)
        if getattr(function, "folds", False):
            self.folds.update(vector.number for call in self.calls[first:] for vector in call.outputs)
        return tree

    def gathered(self, tree: T) -> T:
        """One chain for each body."""
        assert isinstance(tree, tuple)
        return tuple(self.opened(part, body) for body, part in enumerate(tree))  # type: ignore[return-value]

    def opened(self, tree: T, body: int | None) -> T:
        """The same tree in new vectors, its constants too."""
        leaves: list[Expr] = []
        shape = dismantle(tree, leaves)
        columns: dict[int, list[Any]] = {}
        codes = [leaf.codes if isinstance(leaf, TracedMatrix) else self._codes(leaf) for leaf in leaves]
        for slot, each in zip(slots_of(shape), codes, strict=True):
            columns.setdefault(slot, []).extend(each)
        taken = {slot: self._root(column, body) for slot, column in columns.items() if column}
        after = dict.fromkeys(columns, 0)
        found = []
        for slot, leaf, each in zip(slots_of(shape), leaves, codes, strict=True):
            moved = tuple((taken[slot].number, after[slot] + k) for k in range(len(each)))
            after[slot] += len(each)
            found.append(TracedMatrix(leaf.leaf if isinstance(leaf, TracedMatrix) else outline(leaf), moved))
        together: T = rebuild(shape, iter(found))
        return together

    def in_sight(self, bodies: Sequence[Any], striking: Any) -> None:
        """See ``decorator.in_sight``."""
        first = len(self.calls)
        for body, sight in enumerate(bodies):
            self.opened(sight, body)
        self.opened(striking, None)
        for k, call in enumerate(self.calls[first:], first):
            (vector,) = call.outputs
            named = vector._replace(name="sight")
            self.calls[k] = call._replace(outputs=(named,))
            self.sights.append(vector.number)

    def _root(self, column: Sequence[Any], body: int | None) -> TracedVector:
        used: dict[int, int] = {}
        for code in column:
            if not isinstance(code, float):
                used.setdefault(code[0], len(used))
        symbols = [ca.SX.sym("a", self._sizes[k]) for k in used]
        entries = [ca.SX(c) if isinstance(c, float) else symbols[used[c[0]]][c[1]] for c in column]
        function = self._pieces.shared(ca.Function("piece", symbols, [ca.vertcat(*entries)]))
        (number,) = self._add("", function, list(used))
        self.roots[number] = body
        return self._slots[number]
