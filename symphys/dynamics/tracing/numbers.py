"""Constant folding across calls: expressions of known numbers are evaluated when a step is traced.

Numbers of bodies and laws are arguments of calls, so that calls which differ in them share a function. A function with
known arguments is split: expressions of these alone, such as an effective mass of a radius and a mass, are evaluated
here, and the rest takes their values as an argument.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from symphys.dynamics.tracing.recording import TracedCall, TracedVector
from symphys.types import Expr

Mask = tuple[tuple[bool, ...], ...]
"""Which entries of each input are known."""


class Split(NamedTuple):
    """A function that is given known numbers.

    Attributes:
        numbers: (k,) known entries of all inputs -> (m,) the numbers that the rest is given, then known results.
        given: m.
        rest: a function of the inputs, and of the numbers if there are any.
        results: of each output, which entries are known, in the order of ``numbers``.
    """

    numbers: ca.Function
    given: int
    rest: ca.Function
    results: Mask


def with_known_numbers(calls: Sequence[TracedCall]) -> list[TracedCall]:
    """Return calls with the same results, of which one first gives the numbers that others need."""
    known, splits = dict[int, list[float | None]](), dict[tuple[int, Mask], Split]()
    vectors, found = dict[bytes, TracedVector](), list[TracedCall]()
    fresh = 1 + max((slot.number for call in calls for slot in (*call.inputs, *call.outputs)), default=0)
    for call in calls:
        entries = [known.get(slot.number) or [None] * slot.size for slot in call.inputs]
        mask = tuple(tuple(value is not None for value in column) for column in entries)
        if call.inputs and not any(map(any, mask)):
            found.append(call)
            continue
        key = id(call.function), mask
        if key not in splits:
            splits[key] = split(call.function, mask)
        made = splits[key]
        values = [value for column in entries for value in column if value is not None]
        numbers = np.array(made.numbers(ca.DM(values))).ravel()
        given, results = numbers[: made.given], iter(numbers[made.given :].tolist())
        for slot, column in zip(call.outputs, made.results, strict=True):
            known[slot.number] = [next(results) if each else None for each in column]
        if not given.size:
            found.append(call)
            continue
        vector = vectors.setdefault(given.tobytes(), TracedVector("", given.size, fresh + len(vectors)))
        found.append(call._replace(function=made.rest, inputs=(*call.inputs, vector)))
    if vectors:
        function = ca.Function("numbers", [], [ca.DM(np.frombuffer(values)) for values in vectors])
        found.insert(0, TracedCall(function, (), tuple(vectors.values())))
    return found


def split(function: ca.Function, mask: Mask) -> Split:
    """Split a function at its known entries."""
    inputs: list[Expr] = [ca.SX.sym("a", len(column)) for column in mask]
    parts, columns = list[Expr](), list[Expr]()
    for symbol, column in zip(inputs, mask, strict=True):
        own = [ca.SX.sym("n") if each else symbol[k] for k, each in enumerate(column)]
        parts += [entry for entry, each in zip(own, column, strict=True) if each]
        columns.append(ca.vertcat(ca.SX(0, 1), *own))
    outputs = [ca.densify(output) for output in function.call(columns, True, False)]
    whole, names, found = ca.vertcat(ca.SX(0, 1), *outputs), list[Expr](), list[Expr]()
    if parts:
        whole, names, found = ca.extract_parametric(whole, ca.vertcat(*parts))
        left = {symbol.element_hash() for symbol in ca.symvar(whole)}
        plain = [part for part in parts if part.element_hash() in left]
        names, found = [*names, *plain], [*found, *plain]
    # Results that are known, as expressions of the known entries.
    values = {each.element_hash(): each for each in parts}
    values |= {name.element_hash(): value for name, value in zip(names, found, strict=True)}
    entries: list[Expr] = whole.nonzeros()
    results = [each if each.is_constant() else values.get(each.element_hash()) for each in entries]
    columns = ca.vertsplit(whole, np.cumsum([0, *(output.numel() for output in outputs)]).tolist())
    flags = iter(result is not None for result in results)
    known = tuple(tuple(next(flags) for _ in range(output.numel())) for output in outputs)
    numbers = [*found, *(result for result in results if result is not None)]
    return Split(
        numbers=ca.Function("numbers", [ca.vertcat(ca.SX(0, 1), *parts)], [ca.vertcat(ca.SX(0, 1), *numbers)]),
        given=len(found),
        rest=ca.Function("piece", [*inputs, ca.vertcat(*names)], columns) if names else function,
        results=known,
    )
