"""Calls of one function that follow each other, such as sweeps, as fewer calls that do several at once.

Sweeps all read the same places, and the adjoint of each adds to the same words. One call of several adds once. Calls
that may be left out stay by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen.program.program import Function, FunctionCall, Place, Program

AT_ONCE = 4
SMALLEST = 400
"""Instructions of a function below which its calls are left as they are."""
Key = tuple[int, int]


def merged(program: Program) -> list[FunctionCall]:
    """The calls of a program of one step, in order."""
    calls, found = list(program.calls), list[FunctionCall]()
    reads = np.zeros(program.size, np.int64)
    for call in calls:
        _count(reads, call.inputs, 1)
    _count(reads, list(program.outputs.values()), 1)
    known: dict[tuple[object, ...], Function] = {}
    for _, group in groupby(calls, key=lambda call: call.function.__hash__()):
        same = list(group)
        left_out = any(call.guard or call.section for call in same)
        if left_out or same[0].function.n_instructions() < SMALLEST or not _chained(same):
            found += same
            continue
        for first in range(0, len(same), AT_ONCE):
            found.append(_together(same[first : first + AT_ONCE], reads, known))
    return found


def _together(
    calls: Sequence[FunctionCall], reads: NDArray[np.int64], known: dict[tuple[object, ...], Function]
) -> FunctionCall:
    """One call that does all of these; ``reads``: by how many calls and outputs each word is read."""
    inside = np.zeros_like(reads)
    for call in calls:
        _count(inside, call.inputs, 1)
    made = {_key(place) for call in calls for place in call.outputs}
    inputs = dict.fromkeys(_key(place) for call in calls for place in call.inputs if _key(place) not in made)
    kept = [place for call in calls for place in call.outputs if (reads > inside)[_words(place)].any()]
    numbers = {key: i for i, key in enumerate([*inputs, *(_key(place) for call in calls for place in call.outputs)])}
    function = calls[0].function
    wiring = tuple(tuple(numbers[_key(place)] for place in call.inputs) for call in calls)
    pattern = (function.__hash__(), len(inputs), wiring, tuple(numbers[_key(place)] for place in kept))
    if pattern not in known:
        values = {key: ca.SX.sym("a", key[1]) for key in inputs}
        symbols = list(values.values())
        for call in calls:
            results = function.call([values[_key(place)] for place in call.inputs], True, False)
            values |= {_key(place): result for place, result in zip(call.outputs, results, strict=True)}
        known[pattern] = ca.Function(function.name(), symbols, [ca.densify(values[_key(place)]) for place in kept])
    return FunctionCall(known[pattern], tuple(Place(*key) for key in inputs), tuple(place.still() for place in kept))


def _chained(calls: Sequence[FunctionCall]) -> bool:
    """Whether each call reads what the one before gave."""
    return len(calls) > 1 and all(
        not {_key(place) for place in before.outputs}.isdisjoint(_key(place) for place in after.inputs)
        for before, after in pairwise(calls)
    )


def _key(place: Place) -> Key:
    return place.offset, place.size


def _words(place: Place) -> slice:
    return slice(place.offset, place.offset + place.size)


def _count(counts: NDArray[np.int64], places: Sequence[Place], more: int) -> None:
    for place in places:
        counts[_words(place)] += more
