"""A step of many bodies as data: calls of a sample's step, and loops of these over all members."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from symphys.codegen.program.program import Place, Program

ONLY = 0
"""The number of the room of what is there once."""


class Of(IntEnum):
    """Whose words are copied: a member's own, those of a pair's bodies, what is there once, what a pair had then."""

    OWN = 0
    FIRST = 1
    SECOND = 2
    ONCE = 3
    THEN = 4


class Store(IntEnum):
    """What is copied from or to: work of a step, the state before or after it, or what is given for all steps."""

    WORK = 0
    BEFORE = 1
    AFTER = 2
    GIVEN = 3


class Word(NamedTuple):
    """One that is 0 where something is without effect: the number of its sieve, and which word of that it is."""

    sieve: int
    point: int


@dataclass(frozen=True)
class Sieve:
    """Words by which members are told apart.

    Attributes:
        room: whose members.
        places: of the words, in the work of a member.
        loop: number of the loop before which they are looked at, once a step.
    """

    room: int
    places: tuple[int, ...]
    loop: int


@dataclass(frozen=True)
class Move:
    """Words that are copied between the work of a member and another store.

    Attributes:
        store: the other.
        room: of that.
        of: whose.
        offset: there.
        at: in the member's work.
        size: words.
        out: whether they are copied from the member.
        guard: a word that is 0 if this may be left out; None: it may not.
    """

    store: Store
    room: int
    of: Of
    offset: int
    at: int
    size: int
    out: bool = False
    guard: Word | None = None


class MemberReference(NamedTuple):
    """Words that are read where they lie; see ``Move``."""

    store: Store
    room: int
    of: Of
    offset: int


@dataclass(frozen=True)
class MemberCall:
    """A call for a member.

    Attributes:
        number: of the call in the sample's body.
        inputs, outputs: where they begin in the work of the member, or elsewhere.
        guard: a word that is 0 if results are 0 or not read; None: the call is always needed.
        cleared: (start, words) of results that are read where that word is 0.
    """

    number: int
    inputs: tuple[int | MemberReference, ...]
    outputs: tuple[int, ...]
    guard: Word | None = None
    cleared: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class MemberLoop:
    """What each member of a room does before the next one begins.

    Attributes:
        room: whose members.
        does: in order.
        section: where in the work of what is there once a word is 0 if this is left out; None: it never is.
        instead: what is copied then.
    """

    room: int
    does: tuple[Move | MemberCall, ...]
    section: int | None = None
    instead: tuple[Move, ...] = ()


@dataclass(frozen=True)
class Room:
    """Members that are alike.

    Attributes:
        work: words of a member in a step.
        state: words of a member from step to step.
        members: how many there are; of pairs: at most.
    """

    work: int
    state: int
    members: int


@dataclass(frozen=True)
class SightPlaces:
    """Where in the work of a body its position (3) and its reach lie [m]."""

    position: int
    reach: int


@dataclass(frozen=True)
class Meeting:
    """Which members meet as a pair.

    Attributes:
        first, second: numbers of species; second -1: a plane.
        normal, offset: of the plane.
    """

    first: int
    second: int = -1
    normal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset: float = 0.0


@dataclass(frozen=True)
class Crowd:
    """A step of many bodies.

    Attributes:
        sample: one step of a few bodies: its z is their state, "x" the state after.
        loops: in order.
        sieves: whose words guards are, in the order of their loops.
        rooms: what is there once, then each species, then the pairs of each meeting.
        meetings: of the rooms of pairs.
        sights: of the species.
        striking: where in the work of what is there once it says how far anything comes in a step [m].
        found: number of the loop before which pairs are looked for.
        looked: number of the loop from which on only those are left that are near.
        nears: by meeting, where in the work of a pair words lie of which one is not 0 if it is near.
        given: words that are given for all steps.
        chains: where in the sample lies what members hand on as it begins.
        taped: the same for adjoints, where they are faster with other calls.
    """

    sample: Program
    loops: tuple[MemberLoop, ...]
    sieves: tuple[Sieve, ...]
    rooms: tuple[Room, ...]
    meetings: tuple[Meeting, ...]
    sights: tuple[SightPlaces, ...]
    striking: int
    found: int
    looked: int
    nears: tuple[tuple[int, ...], ...]
    given: int
    chains: tuple[Place, ...]
    taped: Crowd | None = None

    @property
    def state(self) -> int:
        """Words of the state of all."""
        return sum(room.state * room.members for room in self.rooms)
