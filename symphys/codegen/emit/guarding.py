"""Tables by which the driver skips calls without effect.

A guard is a word that is 0 where a call changes nothing. A result of a call that is left out stands for another place:
that of an argument, or of zeros. Results that stand for one another form a chain, such as the velocity of a body after
each of its contacts. Whoever reads the newest of a chain reads what was written last by a call that was not left out,
and its adjoint adds there. The driver notes which calls are left and where they read (``guards.c``), and keeps that for
as long as it has all calls that are needed.

A section is a run of calls that is left out where one word is 0, such as those of an impact. Its results are copied
then.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.tables import Table
from symphys.codegen.errors import ProgramError
from symphys.codegen.program.program import FunctionCall, Place, Program
from symphys.records import dataclass
from symphys.types import Ints

NONE = -1
TABLES = ("body", "again", "back_body")
LOOKAHEAD = 16
"""Entries of lookahead, the same as in ``guards.c``."""
WIDTHS = {"guards": 1, "groups": 1, "calls": 7, "reads": 2, "writes": 2, "chains": 2, "sections": 5, "copies": 5}


@dataclass(frozen=True)
class Guarding:
    """Guards and sections of a program's body.

    Attributes:
        first: calls of the body up to the last that computes a guard; none of them has one.
        rows: what the driver reads, by names of ``WIDTHS``, in rows of these widths:

            - guards: offset of the word;
            - groups: the numbers of calls by guard, those without one last, after the ends of these groups;
            - calls: where its entry begins in each of ``TABLES``, laid one after the other (-1: it has none); where its
              reads forwards, its reads backwards, its writes and its copies begin. A row more than there are calls;
            - reads: position in the tables, chain;
            - writes: chain, offset;
            - chains: offset and stride where each begins;
            - sections: first call, the one after the last; chain of its word, offset in it, 0; or -1, offset, stride;
            - copies: offset; chain of the source, offset in it, 0; or -1, offset, stride; size.
        arena: words of 8 bytes that the driver needs for itself.
    """

    first: int
    rows: dict[str, Ints]
    arena: int

    def count(self, name: str) -> int:
        """Return the number of rows of a kind; of calls without the last."""
        return len(self.rows[name]) // WIDTHS[name] - (name == "calls")

    def calls_of(self, table: str) -> Ints:
        """Return the numbers of the calls that one of ``TABLES`` has, in its order."""
        starts = self.rows["calls"].reshape(-1, WIDTHS["calls"])[:-1, TABLES.index(table)]
        order = np.argsort(starts, kind="stable")
        return order[np.count_nonzero(starts == NONE) :]

    def mark_redirected(self, moves: NDArray[np.bool_]) -> None:
        """Mark the strides in the tables that the driver replaces by that of a chain which moves with the step."""
        positions, chains = self.rows["reads"].reshape(-1, 2).T
        moves[positions + 1] |= self.rows["chains"].reshape(-1, 2)[chains, 1] != 0


def guarding_of(program: Program, tables: Mapping[str, Table]) -> Guarding | None:
    """Return the guards and sections of a program; None if it has neither.

    Args:
        program: whose body has calls with guards.
        tables: for each of ``TABLES`` the entries.
    """
    body = _followed(program)
    if not any(call.guard or call.section for call in body):
        return None
    guards = list(dict.fromkeys(call.guard.offset for call in body if call.guard is not None))
    computes = program.phases[1].outputs
    first = 1 + int(computes.call[np.isin(computes.offset, np.array(guards, np.int64))].max(initial=NONE))
    if (early := next((call for call in body[:first] if call.guard is not None), None)) is not None:
        raise ProgramError(f"{early.function.name()}: it has a guard, and comes before all guards are computed")
    rows = _Rows(program, body, guards)
    rows.lay(tables)
    return rows.guarding(first)


class _Rows:
    """The rows of ``Guarding``, from the calls of a body in their order."""

    def __init__(self, program: Program, body: Sequence[FunctionCall], guards: Sequence[int]) -> None:
        self._program, self._body, self._guards = program, body, guards
        self._chains = _Chains(program.size)
        self._starts = np.full((len(body) + 1, WIDTHS["calls"]), NONE, np.int64)
        self._reads: Ints = np.zeros((0, 2), np.int64)
        self._writes: list[tuple[int, int]] = []
        self._copies: list[tuple[int, ...]] = []
        self._sections: list[tuple[int, ...]] = []
        self._words = 0

    def lay(self, tables: Mapping[str, Table]) -> None:
        """Lay out the calls as they follow one another, then their entries in all tables."""
        before: list[tuple[int, int]] = []
        for k, call in enumerate(self._body):
            if call.section is not None:
                self._section(k, call)
            before.append((len(self._writes), len(self._copies)))
            if call.guard is not None or call.section is not None:
                self._write(call)
        self._starts[:-1, 5:] = np.array(before, np.int64).reshape(-1, 2)
        self._starts[-1, 5:] = len(self._writes), len(self._copies)
        chain = np.array(self._chains.of_words(), np.int64)
        found = [np.zeros((3, 0), np.int64)]
        for number, name in enumerate(TABLES):
            starts = tables[name].start_of(len(self._body))
            self._starts[:-1, number] = np.where(starts == NONE, NONE, starts + self._words)
            found += self._read(tables[name], chain)
            if number == 0:
                forward = sum(each.shape[1] for each in found)
            self._words += len(tables[name].words)
        self._put(np.concatenate(found, axis=1), forward)

    def _read(self, table: Table, chain: Ints) -> Iterator[Ints]:
        """Return call, position and chain (3, reads) where entries have a place of a chain."""
        inputs = self._program.phases[1].inputs
        whole = np.where((inputs.stride == 0) & (inputs.size > 0), chain[inputs.offset % max(len(chain), 1)], NONE)
        for rows, (_, columns) in zip(table.rows, table.recipes, strict=True):
            calls, at = table.calls[rows], table.starts[rows] + self._words
            for k, (side, i) in enumerate(columns):
                if side == "in":
                    own = whole[inputs.starts[calls] + i]
                    on = own != NONE
                    yield np.stack([calls[on], at[on] + 2 + 2 * k, own[on]])

    def _put(self, found: Ints, forward: int) -> None:
        """Add reads by their calls; of each call those of the first ``forward`` first."""
        counts = [np.bincount(each, minlength=len(self._body)) for each in (found[0, :forward], found[0, forward:])]
        ends = np.cumsum(counts[0] + counts[1])
        self._starts[:-1, 3] = ends - counts[0] - counts[1]
        self._starts[:-1, 4] = ends - counts[1]
        self._starts[-1, 3:5] = found.shape[1]
        self._reads = found[1:, np.lexsort((found[1], found[0]))].T

    def _write(self, call: FunctionCall) -> None:
        for place, other in zip(call.outputs, call.beside, strict=False):
            if other is not None:
                self._copies.append((place.offset, *self._chains.source(other), place.size))
        for place, other in zip(call.outputs, call.otherwise, strict=False):
            if other is not None and call.guard is not None:
                self._writes.append((self._chains.extend(place, other), place.offset))

    def _section(self, k: int, call: FunctionCall) -> None:
        assert call.section is not None
        before = self._body[k - 1].section if k else None
        if call.section is not before and call.section != before:
            end = next((j for j in range(k, len(self._body)) if self._body[j].section != call.section), len(self._body))
            self._sections.append((k, end, *self._chains.source(call.section)))

    def guarding(self, first: int) -> Guarding:
        """Return all rows; ``first``: calls up to the last that computes a guard."""
        word = {offset: g for g, offset in enumerate(self._guards)}
        groups: list[list[int]] = [[] for _ in range(len(word) + 1)]
        for k, call in enumerate(self._body):
            groups[NONE if call.guard is None else word[call.guard.offset]].append(k)
        listed: dict[str, Any] = {
            "guards": self._guards,
            "groups": [*np.cumsum([len(group) for group in groups]), *(k for group in groups for k in group)],
            "calls": self._starts,
            "reads": self._reads,
            "writes": self._writes,
            "chains": self._chains.roots,
            "sections": self._sections,
            "copies": self._copies,
        }
        rows = {name: np.array(each, np.int64).ravel() for name, each in listed.items()}
        self._gather_chains(rows, word)
        calls, sections = len(self._body), len(self._sections)
        seen = (2 + self._program.steps) * len(self._guards) // 8 + 1
        notes = calls // 64 + 1 + calls + LOOKAHEAD + 3 * (calls + sections) + 2 * len(self._chains.roots)
        arena = 1 + 64 + seen + notes + self._words
        return Guarding(
            first=first,
            rows=rows,
            arena=arena + 3 * (6 * sections + 4 * len(self._copies)),
        )

    def _gather_chains(self, rows: Mapping[str, Ints], word: Mapping[int, int]) -> None:
        """Number the chains that begin with calls of one guard one after the other, so that they lie side by side."""
        if not self._writes:
            return
        chains = np.array(self._writes, np.int64)[:, 0]
        begins = np.unique(chains, return_index=True)[1]
        whose = np.repeat(np.arange(len(self._body)), np.diff(self._starts[:, 5]))[begins]
        guards = [word[call.guard.offset] for call in (self._body[k] for k in whose) if call.guard is not None]
        order = np.argsort(np.array(guards), kind="stable")
        number = np.empty_like(order)
        number[order] = np.arange(len(order))
        rows["chains"].reshape(-1, 2)[:] = rows["chains"].reshape(-1, 2)[order]
        for name, column in (("reads", 1), ("writes", 0), ("sections", 2), ("copies", 1)):
            each = rows[name].reshape(-1, WIDTHS[name])[:, column]
            each[each != NONE] = number[each[each != NONE]]


class _Chains:
    """Chains of results, while calls follow one another."""

    def __init__(self, size: int) -> None:
        self.roots: list[tuple[int, int]] = []
        self._newest: list[Place] = []
        self._chain = [NONE] * size

    def of_words(self) -> list[int]:
        """Map each word, which is written once, to its chain."""
        return self._chain

    def of(self, place: Place) -> int:
        """Return the chain whose newest result has this place, all of it or a part; NONE if it is part of none."""
        return NONE if place.stride or not place.size else self._chain[place.offset]

    def follows(self, place: Place) -> bool:
        """Whether what is read there is the newest of its chain as it was written, or part of no chain."""
        if place.stride or not place.size:
            return True
        chains = self._chain[place.offset : place.offset + place.size]
        first = chains[0]
        if chains.count(first) < place.size:
            return False
        return first == NONE or self._newest[first] is place or self._newest[first] == place

    def holds(self, place: Place) -> bool:
        """Whether a place is part of the newest of its chain, or of no chain."""
        chain = self.of(place)
        if chain == NONE:
            return True
        newest = self._newest[chain]
        return newest.offset <= place.offset and place.offset + place.size <= newest.offset + newest.size

    def source(self, place: Place) -> tuple[int, int, int]:
        """Return (chain, offset in it, 0), or (NONE, offset, stride)."""
        chain = self.of(place)
        if chain == NONE:
            return NONE, place.offset, place.stride
        return chain, place.offset - self._newest[chain].offset, 0

    def extend(self, place: Place, other: Place) -> int:
        """Return the chain that a result goes on with, for which ``other`` may stand.

        A new one if that is part of none.
        """
        chain = self.of(other)
        if chain == NONE:
            chain = len(self.roots)
            self.roots.append((other.offset, other.stride))
            self._newest.append(other)
        self._newest[chain] = place
        self._chain[place.offset : place.offset + place.size] = [chain] * place.size
        return chain


def _followed(program: Program) -> list[FunctionCall]:
    """Return the body without those guards whose chains somebody reads elsewhere than at their ends."""
    body = list(program.body)
    for call in body:
        _check(call)
    while (guard := _unfollowed(program.size, body)) is not None:
        body = [replace(call, guard=None, otherwise=()) if call.guard == guard else call for call in body]
    return body


def _unfollowed(size: int, body: Sequence[FunctionCall]) -> Place | None:
    """Return a guard whose results are read where they are not the newest."""
    chains, guards = _Chains(size), dict[int, Place]()
    for call in body:
        copied = [place for place in (call.section, *call.beside) if place is not None]
        for place in (*call.inputs, *(place for place in copied if not chains.holds(place))):
            if not chains.follows(place):
                return guards[place.offset] if place.offset in guards else next(iter(guards.values()))
        for place, other in zip(call.outputs, call.otherwise, strict=False):
            if other is not None and call.guard is not None:
                if not chains.follows(other):
                    return call.guard
                chains.extend(place, other)
                guards[place.offset] = call.guard
    return None


def _check(call: FunctionCall) -> None:
    """Refuse what the driver cannot follow."""
    who = call.function.name()
    for word, others, what in ((call.guard, call.otherwise, "guard"), (call.section, call.beside, "section")):
        if word is None:
            continue
        if word.size != 1 or word.stride:
            raise ProgramError(f"{who}: the word of its {what} is not one of scratch but {word}")
        if len(others) != len(call.outputs) or call.accumulate:
            raise ProgramError(f"{who}: with a {what} it says of each result what stands for it, and adds to nothing")
        for place, other in zip(call.outputs, others, strict=True):
            if other is not None and (place.stride or other.size != place.size):
                raise ProgramError(f"{who}: {other} cannot stand for {place}")
