"""Calls of a step that may be left out, in a program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from symphys.codegen import FunctionCall, Place
from symphys.dynamics.tracing.guards import Guard, Part
from symphys.dynamics.tracing.recording import TracedCall, TracedVector


def most_zeros(calls: Sequence[TracedCall]) -> int:
    """The size of the longest result that zeros stand for."""
    return max(
        (
            vector.size
            for call in calls
            for guard in (call.guard, call.section)
            if guard is not None
            for vector, part in zip(call.outputs, guard.otherwise, strict=True)
            if part is not None and part.vector is None
        ),
        default=0,
    )


def guarded(
    call: FunctionCall, traced: TracedCall, places: Mapping[TracedVector, Place], zeros: Place | None
) -> FunctionCall:
    """The call with its guard and its section, whose vectors lie in ``places``."""

    def part_of(part: Part, size: int) -> Place:
        whole = zeros if part.vector is None else places[part.vector]
        assert whole is not None
        return Place(whole.offset + part.start, size, whole.stride)

    def stand_ins(guard: Guard) -> tuple[Place | None, ...]:
        parts = zip(call.outputs, guard.otherwise, strict=True)
        return tuple(None if part is None else part_of(part, place.size) for place, part in parts)

    if traced.guard is not None:
        call = replace(call, guard=part_of(traced.guard.word, 1), otherwise=stand_ins(traced.guard))
    if traced.section is not None:
        call = replace(call, section=part_of(traced.section.word, 1), beside=stand_ins(traced.section))
    return call
