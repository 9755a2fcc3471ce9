"""Alternatives of calls without effect: copies, after which all words hold the values that the call would give.

What stands for its results is copied. The processor's driver for rollouts copies nothing, as it sends readers elsewhere
(``guarding.py``). On a device, and in Jacobians of a step, places are given.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, groupby
from typing import NamedTuple

from symphys.codegen.program.program import FunctionCall, Place

NONE = -1
LEFT_OUT = -1
"""Stands for the number of a function in an entry of copies."""


class Span(NamedTuple):
    """Words of a place at step 0, and how far they move with a step."""

    offset: int
    stride: int
    size: int


class Copy(NamedTuple):
    """A copy from ``source`` to ``offset``; adjoints are added the other way, and a source of -1 has none."""

    offset: int
    source: int
    stride: int
    size: int


class Alternative(NamedTuple):
    """The word at whose 0 a call may be skipped, and the copies that replace it.

    Attributes:
        word: where this is 0.
        copies: instead.
        reads: the places of values that take part.
    """

    word: int
    copies: tuple[Copy, ...]
    reads: tuple[Span, ...]


Alternatives = tuple[Alternative | None, Alternative | None]
"""Alternatives by the section and by the guard of a call."""
ALWAYS: Alternatives = (None, None)
"""Those of a call that is never left out."""


def of_call(call: FunctionCall) -> Alternatives:
    """Name the function of a call."""
    return _section_and_guard(call, None)


def of_adjoint(call: FunctionCall, results: Sequence[Span], arguments: Sequence[Span]) -> Alternatives:
    """Name the adjoint of a call with respect to these results and arguments."""
    return _section_and_guard(call, (results, arguments))


def word_of(alternative: Alternative | None) -> int:
    """Return the word of an alternative; -1 if there is none."""
    return NONE if alternative is None else alternative.word


def entries_of(calls: Sequence[tuple[list[int], Alternatives]], depth: int = 0) -> list[int]:
    """Return the entries of calls that follow one another; those that share a word come after one that leaves them out.

    That one is LEFT_OUT, its length, words from its begin to what comes after these calls, the word, the copies.
    """
    if depth == 2:
        return [x for entry, _ in calls for x in entry]
    found = list[int]()
    for word, group in groupby(calls, lambda call: word_of(call[1][depth])):
        same = list(group)
        entries = entries_of(same, depth + 1)
        if word != NONE:
            others = [other for _, alternatives in same if (other := alternatives[depth]) is not None]
            copies = [x for other in others for copy in other.copies for x in copy]
            length = 4 + len(copies)
            found += [LEFT_OUT, length, length + len(entries), word, *copies]
        found += entries
    return found


def _section_and_guard(call: FunctionCall, adjoint: tuple[Sequence[Span], Sequence[Span]] | None) -> Alternatives:
    section, guard = (
        _alternative(call, word, others, adjoint)
        for word, others in ((call.section, call.beside), (call.guard, call.otherwise))
    )
    return section, guard


def _alternative(
    call: FunctionCall,
    word: Place | None,
    others: Sequence[Place | None],
    adjoint: tuple[Sequence[Span], Sequence[Span]] | None,
) -> Alternative | None:
    both = zip(call.outputs, others, strict=False)
    pairs = [(place, other) for place, other in both if other is not None and place.size]
    if word is None or _meet([other for _, other in pairs if _read(other, call)]):
        return None
    reads = [Span(word.offset, 0, 1)]
    if adjoint is None:
        copies = [Copy(place.offset, other.offset, other.stride, place.size) for place, other in pairs]
        reads += [Span(other.offset, other.stride, other.size) for _, other in pairs]
    else:
        active = {span.offset for span in adjoint[0] if span.size}
        on = [(place, other) for place, other in pairs if place.offset in active]
        copies = [Copy(place.offset, *_source(other, adjoint[1]), place.size) for place, other in on]
    return Alternative(word.offset, tuple(copies), tuple(reads))


def _source(place: Place, arguments: Sequence[Span]) -> tuple[int, int]:
    for offset, stride, size in arguments:
        if stride == place.stride and offset <= place.offset and place.offset + place.size <= offset + size:
            return place.offset, place.stride
    return NONE, 0


def _read(place: Place, call: FunctionCall) -> bool:
    """Whether a call reads a place: to others, such as zeros, no adjoints are added."""
    return any(_overlap(each, place) for each in call.inputs)


def _meet(places: Sequence[Place]) -> bool:
    """Whether two share a word: their adjoints would be added up in another order."""
    return any(_overlap(a, b) for a, b in combinations(places, 2))


def _overlap(a: Place, b: Place) -> bool:
    return a.offset < b.offset + b.size and b.offset < a.offset + a.size
