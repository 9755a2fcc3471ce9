"""The calls of a sample's step as loops over bodies and over pairs that are near.

Each call belongs to all, to a body or to a pair. What a pair hands on to the next pair of a body, such as the body's
velocity, is a chain: its newest version lies in one place, from which a call copies it, and to which it copies its own
version. That a result is a version of a chain is known from ``tracing.guards``: it stays as it was where a pair is far.
Of bodies and pairs that are alike only the first is kept.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from symphys.codegen.neighbours.program import ONLY, MemberCall, MemberLoop, Move, Of, Sieve, Store, Word
from symphys.dynamics.neighbours.sample import TWINS, Sample
from symphys.dynamics.neighbours.step import RecordedStep
from symphys.dynamics.tracing.guards import Guard, Part
from symphys.dynamics.tracing.recording import TracedCall, TracedVector
from symphys.errors import SymphysError
from symphys.transcription.neighbours.clearing import with_clearing

NONE = -1
MOST_WORDS = 31
"""Of a sieve, which are bits of an integer; points of a pair beyond these are always computed."""


@dataclass(frozen=True)
class LoopStep:
    """A step as loops.

    Attributes:
        loops: in order.
        sieves: in the order of their loops.
        work, states: words of a member of each room: first what is there once, then each species, then pairs by kind.
        homes: for the numbers of vectors (room, where they lie in its work).
    """

    loops: tuple[MemberLoop, ...]
    sieves: tuple[Sieve, ...]
    work: tuple[int, ...]
    states: tuple[int, ...]
    homes: Mapping[int, tuple[int, int]]


Owner = tuple[str, int]
"""("all", 0), ("body", its index in the sample) or ("pair", that of the first of its points)."""
ONCE: Owner = "all", 0


def loops_of(sample: Sample, recorded: RecordedStep) -> LoopStep:
    """The calls of a step of a sample as loops; SymphysError where they cannot be."""
    return _Builder(sample, recorded).built(recorded.calls)


@dataclass
class _Loop:
    """A loop that grows."""

    room: int
    section: Part | None
    does: list[Move | MemberCall] = field(default_factory=list)
    instead: list[Move] = field(default_factory=list)
    made: set[int] = field(default_factory=set)
    """Numbers of the vectors that its calls have computed."""

    def done(self, section: int | None) -> MemberLoop:
        """As it is; ``section``: where its word lies."""
        return MemberLoop(self.room, tuple(self.does), section, tuple(self.instead))


class _Builder:
    """Goes through the calls of a sample once."""

    def __init__(self, sample: Sample, recorded: RecordedStep) -> None:
        self._sample, self._recorder, self._names = sample, recorded.recorder, recorded.names
        sizes = list(recorded.sizes.values())
        self._given = {name: sum(sizes[:k]) for k, name in enumerate(recorded.sizes)}
        self._members: dict[str, Owner] = {"": ONCE}
        self._members |= {body.name: ("body", k) for k, body in enumerate(sample.world.bodies)}
        leads: dict[Hashable, int] = {}
        for k, pair in enumerate(sample.world.pairs):
            self._members[pair.name] = "pair", leads.setdefault((pair.first, pair.second), k)
        self._of_word = {number: ("pair", leads[sides]) for number, sides in self._recorder.words.items()}
        self._points, self._words, self._sifted = self._recorder.points, dict[int, Word](), list[list[int]]()
        self._kinds = {own[0]: kind for kind, own in enumerate(sample.pairs)}
        self._sift()
        rooms = 1 + len(sample.species) + len(sample.kinds)
        self._work, self._states = [0] * rooms, [0] * rooms
        self._loops: list[_Loop] = []
        self._touched: dict[int, bool] = {}
        self._reached = NONE
        self._readers: dict[int, Owner | None] = {}
        self._owner: dict[int, Owner] = {}
        self._root: dict[int, int] = {}
        self._newest: dict[int, int] = {}
        self._twin: dict[int, int] = {}
        self._keys: dict[Hashable, list[tuple[int, ...]]] = {}
        self._copies: dict[tuple[int, int, Part | None], int] = {}
        self._homes: dict[int, tuple[int, int]] = {}

    def built(self, calls: Sequence[TracedCall]) -> LoopStep:
        """All calls as loops."""
        self._readers = self._read_by(calls)
        for number, call in enumerate(calls):
            for vector in call.inputs:
                if vector.name:
                    self._owner.setdefault(vector.number, self._members[self._names.owners.get(vector.name, "")])
            member = self._member(call)
            self._note(call, member)
            if member[0] == "body":
                self._match(call, member[1])
            room = self._room(member)
            if room is not None:
                self._put(number, call, member, room)
            for vector in call.outputs:
                if vector.number in self._root:
                    self._newest[self._root[vector.number]] = vector.number
        sieves, kept = self._sieves(), {*self._recorder.words, *self._names.results}
        loops = [loop.done(self._word(loop.section)) for loop in self._loops]
        return LoopStep(
            with_clearing(loops, calls, kept, self._root), sieves, tuple(self._work), tuple(self._states), self._homes
        )

    def _sift(self) -> None:
        """Put the words together that tell the points of a pair apart at one instant."""
        latest: dict[Owner, tuple[int, int]] = {}
        for number, point in self._points.items():
            pair = self._of_word[number]
            if pair[1] not in self._kinds:
                continue
            sieve, last = latest.get(pair, (NONE, NONE))
            if point <= last or sieve == NONE:
                sieve = len(self._sifted)
                self._sifted.append([])
            latest[pair] = sieve, point
            if len(self._sifted[sieve]) < MOST_WORDS:
                self._words[number] = Word(sieve, len(self._sifted[sieve]))
                self._sifted[sieve].append(number)

    def _member(self, call: TracedCall) -> Owner:
        """Who makes a call."""
        if (pair := self._told(call)) is not None:
            return pair
        roots = [self._recorder.roots[v.number] for v in call.outputs if v.number in self._recorder.roots]
        owners = {self._owner[vector.number] for vector in call.inputs} - {ONCE}
        owners |= {("body", body) for body in roots if body is not None}
        if pairs := {owner for owner in owners if owner[0] == "pair"}:
            owners = pairs
        if len(owners) > 1:
            readers = {self._readers.get(vector.number) for vector in call.outputs}
            owners = {owner for owner in readers if owner is not None}
        if len(owners) > 1:
            raise SymphysError(f"neighbours: {call.function} belongs to no single body or pair")
        return owners.pop() if owners else ONCE

    def _told(self, call: TracedCall) -> Owner | None:
        """The pair that a call belongs to, as a guard says."""
        words = [vector.number for vector in call.outputs]
        if call.guard is not None and call.guard.word.vector is not None:
            words.append(call.guard.word.vector.number)
        return next((self._of_word[number] for number in words if number in self._of_word), None)

    def _read_by(self, calls: Sequence[TracedCall]) -> dict[int, Owner | None]:
        """For the numbers of vectors the pair that alone reads them; None: several do."""
        found: dict[int, Owner | None] = {}
        for call in reversed(calls):
            pair = self._told(call)
            if pair is None:
                owners = {found[vector.number] for vector in call.outputs if vector.number in found}
                pair = owners.pop() if len(owners) == 1 else None
            for vector in call.inputs:
                found[vector.number] = pair if found.get(vector.number, pair) == pair else None
        return found

    def _room(self, member: Owner) -> int | None:
        """The room of a member that stands for the others; None for these."""
        what, k = member
        if what == "body":
            return None if k % TWINS else 1 + k // TWINS
        if what == "pair":
            return 1 + len(self._sample.species) + self._kinds[k] if k in self._kinds else None
        return ONLY

    def _note(self, call: TracedCall, member: Owner) -> None:
        """Owners and chains of the results."""
        others = call.guard.otherwise if call.guard is not None else (None,) * len(call.outputs)
        for vector, part in zip(call.outputs, others, strict=True):
            number = vector.number
            before = call.inputs[0] if number in self._recorder.folds else part.vector if part is not None else None
            if number in self._recorder.roots:
                body = self._recorder.roots[number]
                self._owner[number] = ONCE if body is None else ("body", body)
                self._root[number] = number
            elif before is None:
                self._owner[number] = member
            elif before.number not in self._root or before.size != vector.size:
                raise SymphysError(f"neighbours: what {call.function} hands on begins nowhere, or changes its size")
            else:
                self._owner[number], self._root[number] = self._owner[before.number], self._root[before.number]

    def _match(self, call: TracedCall, body: int) -> None:
        """Which vectors of a twin stand for which of the first body: the same call is made as often for both."""
        species, twin = divmod(body, TWINS)
        key = call.function.__hash__(), tuple(map(self._standing, call.inputs)), species
        made = self._keys.setdefault((*key, twin), [])
        made.append(tuple(vector.number for vector in call.outputs))
        if twin:
            first = self._keys.get((*key, 0), [])
            if len(first) < len(made):
                raise SymphysError(f"neighbours: {call.function} is not called for all bodies of a species")
            self._twin |= zip(made[-1], first[len(made) - 1], strict=True)

    def _standing(self, vector: TracedVector) -> Hashable:
        """Equal for a body and its twin."""
        if vector.name:
            what, k = self._owner[vector.number]
            return (what, k // TWINS, self._names.offsets[vector.name]) if what == "body" else vector.name
        root = self._root.get(vector.number)
        return self._first(vector.number) if root is None else ("chain", self._first(root))

    def _put(self, number: int, call: TracedCall, member: Owner, room: int) -> None:
        """A call, what is copied for it, and what it hands on."""
        loop, guard = self._loop(room, call), self._guard(call)
        inputs = tuple(self._copied(loop, vector, member, guard) for vector in call.inputs)
        outputs = tuple(self._take(room, vector.size) for vector in call.outputs)
        loop.does.append(MemberCall(number, inputs, outputs, guard))
        if call.section is not None:
            self._instead(loop, call, call.section, member, inputs, outputs)
        for vector, at in zip(call.outputs, outputs, strict=True):
            self._homes[vector.number] = room, at
            root = self._root.get(vector.number, vector.number)
            if root != vector.number:
                owner, of = self._whose(vector, member, room)
                offset = self._homes[self._first(root)][1]
                loop.does.append(Move(Store.WORK, owner, of, offset, at, vector.size, out=True, guard=guard))
            if vector.number in self._names.results:
                offset = self._names.results[vector.number]
                loop.does.append(Move(Store.AFTER, room, Of.OWN, offset, at, vector.size, out=True))
                self._states[room] = max(self._states[room], offset + vector.size)

    def _instead(
        self, loop: _Loop, call: TracedCall, guard: Guard, member: Owner, inputs: Sequence[int], outputs: Sequence[int]
    ) -> None:
        """What is copied where the section of a call is left out; what is handed on stays as it is."""
        for vector, at, part in zip(call.outputs, outputs, guard.otherwise, strict=True):
            if part is None or vector.number in self._root:
                continue
            if part.vector is None or part.vector not in call.inputs:
                raise SymphysError(f"neighbours: what stands for results of {call.function} is none of its arguments")
            given = inputs[call.inputs.index(part.vector)]
            number = part.vector.number
            if part.vector.name or number in self._root or self._owner[number] != member:
                loop.instead.append(self._read(part.vector, member, loop.room, given))
            loop.instead.append(Move(Store.WORK, loop.room, Of.OWN, given + part.start, at, vector.size))

    def _word(self, section: Part | None) -> int | None:
        """Where the word of a section lies in the work of what is there once."""
        if section is None or section.vector is None:
            return None
        number = section.vector.number
        return self._homes[self._root.get(number, number)][1] + section.start

    def _loop(self, room: int, call: TracedCall) -> _Loop:
        """The loop that a call goes into: a new one where a member would come before another has handed on."""
        read, written = (
            {self._first(self._root[v.number]) for v in vectors if v.number in self._root}
            for vectors in (call.inputs, call.outputs)
        )
        point = self._point(call)
        late = any(self._touched.get(chain, False) for chain in read) or not written.isdisjoint(self._touched)
        late = late and not self._reached < point  # the points of a pair follow one another
        section = None if call.section is None else call.section.word
        last = self._loops[-1] if self._loops else None
        if last is not None and call.guard is not None and call.guard.word.vector is not None:
            late = late or call.guard.word.vector.number in last.made
        if last is None or (last.room, last.section) != (room, section) or late:
            self._loops.append(_Loop(room, section))
            self._touched, self._reached = {}, NONE
        self._reached = max(self._reached, point)
        self._touched |= dict.fromkeys(read, False) | dict.fromkeys(written, True)
        self._loops[-1].made.update(vector.number for vector in call.outputs)
        return self._loops[-1]

    def _point(self, call: TracedCall) -> int:
        """Which point of its pair a call is about; NONE: of none alone."""
        words = [] if call.guard is None or call.guard.word.vector is None else [call.guard.word.vector.number]
        words += [vector.number for vector in call.outputs]
        return next((self._points[number] for number in words if number in self._points), NONE)

    def _guard(self, call: TracedCall) -> Word | None:
        """The word of a call's point."""
        if call.guard is None or call.guard.word.vector is None or call.guard.word.start:
            return None
        return self._words.get(call.guard.word.vector.number)

    def _sieves(self) -> tuple[Sieve, ...]:
        """All that guards use, in the order of their loops, with new numbers of the guards."""
        first: dict[int, int] = {}
        for number, loop in enumerate(self._loops):
            for does in loop.does:
                if does.guard is not None:
                    first.setdefault(does.guard.sieve, number)
        to = {sieve: k for k, sieve in enumerate(first)}
        for loop in self._loops:
            loop.does = [
                does if does.guard is None else replace(does, guard=Word(to[does.guard.sieve], does.guard.point))
                for does in loop.does
            ]
        homes = [[self._homes[number] for number in self._sifted[sieve]] for sieve in first]
        return tuple(
            Sieve(own[0][0], tuple(at for _, at in own), loop) for own, loop in zip(homes, first.values(), strict=True)
        )

    def _copied(self, loop: _Loop, vector: TracedVector, member: Owner, guard: Word | None) -> int:
        """Where a call finds in its own work what it reads."""
        room, number = loop.room, vector.number
        if number in self._root:
            if self._newest[self._root[number]] != number:
                raise SymphysError(f"neighbours: the number {number} is read after it has been handed on")
            at = self._take(room, vector.size)
            loop.does.append(replace(self._read(vector, member, room, at), guard=guard))
            return at
        if not vector.name and self._owner[number] == member:
            return self._homes[number][1]
        for key in ((room, number, None), (room, number, loop.section)):
            if key in self._copies:
                return self._copies[key]
        at = self._copies[key] = self._take(room, vector.size)
        loop.does.append(self._read(vector, member, room, at))
        return at

    def _read(self, vector: TracedVector, member: Owner, room: int, at: int) -> Move:
        """The copy of a vector to a member's work."""
        owner, of = self._whose(vector, member, room)
        if vector.number in self._root:
            return Move(Store.WORK, owner, of, self._homes[self._first(self._root[vector.number])][1], at, vector.size)
        if vector.name in self._given:
            return Move(Store.GIVEN, ONLY, Of.ONCE, self._given[vector.name], at, vector.size)
        if vector.name:
            offset = self._names.offsets[vector.name]
            self._states[owner] = max(self._states[owner], offset + vector.size)
            of = Of.THEN if of is Of.OWN and member[0] == "pair" else of
            return Move(Store.BEFORE, owner, of, offset, at, vector.size)
        return Move(Store.WORK, owner, of, self._homes[self._first(vector.number)][1], at, vector.size)

    def _whose(self, vector: TracedVector, member: Owner, room: int) -> tuple[int, Of]:
        """(the room of a vector's owner, how that is found from the member)."""
        what, k = owner = self._owner[vector.number]
        if owner == member:
            return room, Of.OWN
        if owner == ONCE:
            return ONLY, Of.ONCE
        if what != "body" or member[0] != "pair":
            raise SymphysError("neighbours: a body reads what belongs to another")
        first = self._sample.world.pairs[member[1]].first.body
        return 1 + k // TWINS, Of.FIRST if first == k else Of.SECOND

    def _first(self, number: int) -> int:
        """The vector of the first body that one of its twin stands for."""
        return self._twin.get(number, number)

    def _take(self, room: int, size: int) -> int:
        self._work[room] += size
        return self._work[room] - size
