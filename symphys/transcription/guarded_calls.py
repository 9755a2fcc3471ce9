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
            if call.guard is not None
            for vector, part in zip(call.outputs, call.guard.otherwise, strict=True)
            if part is not None and part.vector is None
        ),
        default=0,
    )


def guarded(
    call: FunctionCall, guard: Guard, places: Mapping[TracedVector, Place], zeros: Place | None
) -> FunctionCall:
    """The call with its guard, whose vectors lie in ``places``."""

    def stand_in(place: Place, part: Part | None) -> Place | None:
        if part is None:
            return None
        whole = zeros if part.vector is None else places[part.vector]
        assert whole is not None
        return Place(whole.offset + part.start, place.size, whole.stride)

    otherwise = tuple(stand_in(place, part) for place, part in zip(call.outputs, guard.otherwise, strict=True))
    return replace(call, guard=places[guard.word], otherwise=otherwise)
