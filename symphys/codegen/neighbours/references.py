"""A crowd whose calls read what lies elsewhere where it lies: for values of one scene alone.

Adjoints want what a call has read, so they need the copy. In lanes scenes have pairs of their own, so that what a call
reads is put together from several places.
"""

from __future__ import annotations

from dataclasses import replace

from symphys.codegen.neighbours.program import Crowd, MemberCall, MemberLoop, MemberReference, Move, Of, Store


def with_references(crowd: Crowd) -> Crowd:
    """The same crowd without copies that calls alone read; what may be missing in the step before is copied still."""
    found: dict[tuple[int, int], int | MemberReference] = {}
    for loop in crowd.loops:
        for does in loop.does:
            if isinstance(does, Move) and _copies(does):
                own = does.store is Store.WORK and does.of is Of.OWN
                place = does.offset if own else MemberReference(does.store, does.room, does.of, does.offset)
                found[loop.room, does.at] = place
    return replace(crowd, loops=tuple(_referring(loop, found) for loop in crowd.loops))


def _copies(move: Move) -> bool:
    return not move.out and move.of is not Of.THEN


def _referring(loop: MemberLoop, places: dict[tuple[int, int], int | MemberReference]) -> MemberLoop:
    does = list[Move | MemberCall]()
    for each in loop.does:
        if isinstance(each, MemberCall):
            inputs = tuple(
                at if isinstance(at, MemberReference) else places.get((loop.room, at), at) for at in each.inputs
            )
            does.append(replace(each, inputs=inputs))
        elif not _copies(each):
            does.append(each)
    return replace(loop, does=tuple(does))
