"""What a device does in place of a call that is without effect: it copies what stands for the results.

The processor's driver copies nothing, as it sends readers elsewhere (``emit/guarding.py``). Here all blocks walk the
same tables, so words have to hold what they would have held.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

from symphys.codegen.program.program import FunctionCall, Place

NONE = -1
Copy = tuple[int, int, int, int]
"""Offset, offset and stride of the source, size. Adjoints go the other way; a source of -1 is one that has none."""


class Span(NamedTuple):
    """Words of a place at step 0, and how far they move with a step."""

    offset: int
    stride: int
    size: int


class Alternative(NamedTuple):
    """When a call may be left out, and what is copied then.

    Attributes:
        word: where this is 0 for all robots of a block.
        copies: where it goes, and from where.
        reads: the places of values that take part.
    """

    word: int
    copies: tuple[Copy, ...]
    reads: tuple[Span, ...]


def of_call(call: FunctionCall) -> list[Alternative | None]:
    """By its section and by its guard."""
    found = list[Alternative | None]()
    for word, pairs in _known(call):
        copies = tuple((place.offset, other.offset, other.stride, place.size) for place, other in pairs)
        reads = [Span(other.offset, other.stride, other.size) for _, other in pairs]
        found.append(None if word is None else Alternative(word.offset, copies, (Span(word.offset, 0, 1), *reads)))
    return found


def of_adjoint(call: FunctionCall, results: Sequence[Span], arguments: Sequence[Span]) -> list[Alternative | None]:
    """The same of the adjoint of a call with respect to these results and arguments."""
    found, active = list[Alternative | None](), {offset for offset, _, size in results if size}
    for word, pairs in _known(call):
        on = [(place, other) for place, other in pairs if place.offset in active]
        copies = tuple((place.offset, *_source(other, arguments), place.size) for place, other in on)
        found.append(None if word is None else Alternative(word.offset, copies, (Span(word.offset, 0, 1),)))
    return found


def _source(place: Place, arguments: Sequence[Span]) -> tuple[int, int]:
    for offset, stride, size in arguments:
        if stride == place.stride and offset <= place.offset and place.offset + place.size <= offset + size:
            return place.offset, place.stride
    return NONE, 0


def _known(call: FunctionCall) -> list[tuple[Place | None, list[tuple[Place, Place]]]]:
    """The words of a call, and its results with what stands for them."""
    found = list[tuple[Place | None, list[tuple[Place, Place]]]]()
    for word, others in ((call.section, call.beside), (call.guard, call.otherwise)):
        both = zip(call.outputs, others, strict=False)
        pairs = [(place, other) for place, other in both if other is not None and place.size]
        found.append((None, []) if _meet([other for _, other in pairs]) else (word, pairs))
    return found


def _meet(places: Sequence[Place]) -> bool:
    """Whether two share a word: their adjoints would be added up in another order."""
    return any(a.offset < b.offset + b.size and b.offset < a.offset + a.size for a, b in combinations(places, 2))
