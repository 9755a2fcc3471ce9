"""Constant folding across calls: the same values, and one function for calls that differ in their numbers."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from symphys.dynamics.tracing.numbers import with_known_numbers
from symphys.dynamics.tracing.recording import TracedCall, TracedVector, without_dead_code


def calls_of(radii: list[float]) -> list[TracedCall]:
    """Two bodies: y = x / (1 + 10 r^2) + r, then z = -r * y, where each r is a result of a call without arguments."""
    x, r, y = ca.SX.sym("x", 2), ca.SX.sym("r"), ca.SX.sym("y", 2)
    divide = ca.Function("divide", [x, r], [x / (1 + 10 * r**2) + r, -r])
    times = ca.Function("times", [r, y], [r * y])
    calls, numbers = list[TracedCall](), iter(range(1, 100))
    for k, radius in enumerate(radii):
        one = ca.Function("radius", [], [ca.DM(radius)])
        start, own = TracedVector("x", 2, 0), TracedVector("", 1, next(numbers))
        left, lever = TracedVector("", 2, next(numbers)), TracedVector("", 1, next(numbers))
        result = TracedVector(f"next {k}", 2, next(numbers))
        calls.append(TracedCall(one, (), (own,)))
        calls.append(TracedCall(divide, (start, own), (left, lever)))
        calls.append(TracedCall(times, (lever, left), (result,)))
    return calls


def values_of(calls: list[TracedCall] | tuple[TracedCall, ...], x: list[float]) -> dict[str, np.ndarray]:
    """Evaluate calls one after the other."""
    known = {0: ca.DM(x)}
    for call in calls:
        results = call.function.call([known[slot.number] for slot in call.inputs])
        known |= {slot.number: result for slot, result in zip(call.outputs, results, strict=True)}
    return {slot.name: np.array(known[slot.number]) for call in calls for slot in call.outputs if slot.name}


@pytest.mark.parametrize("radii", [[0.1, 0.1], [0.1, 0.25]])
def test_values_are_the_same_and_numbers_are_computed_once(radii: list[float]) -> None:
    calls = calls_of(radii)
    found = without_dead_code(with_known_numbers(calls))
    known = values_of(calls, [0.3, -2.0])
    assert all(np.array_equal(each, known[name]) for name, each in values_of(found, [0.3, -2.0]).items())
    # One call without arguments gives all numbers; nothing else computes with them alone.
    assert [bool(call.inputs) for call in found] == [False, *[True] * (len(found) - 1)]
    assert len(found) == 5 and len({id(call.function) for call in found[1:]}) == 2
    assert len(found[0].outputs) == 2 * len(set(radii))


def test_functions_of_unknown_numbers_stay() -> None:
    x = ca.SX.sym("x", 2)
    start, result = TracedVector("x", 2, 0), TracedVector("next", 2, 1)
    call = TracedCall(ca.Function("double", [x], [2 * x]), (start,), (result,))
    assert with_known_numbers([call]) == [call]
