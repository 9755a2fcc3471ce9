"""The calls of a phase as arrays, for operations on all calls at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from symphys.codegen.program.calls import Function, FunctionCall
from symphys.codegen.program.spans import Spans
from symphys.types import Bools, Ints


class PhaseCalls:
    """Calls that follow one another.

    Attributes:
        calls: as they are.
        functions: each once, in the order in which they are called first.
        number: (calls,) whose function is whose.
        inputs, outputs: the places.
        accumulate: (calls,) which add.
    """

    def __init__(self, calls: Sequence[FunctionCall]) -> None:
        """Look at each call once."""
        self.calls = calls
        self.functions: list[Function] = []
        by_address, by_hash, numbers = dict[int, int](), dict[int, int](), list[int]()
        for call in calls:
            number = by_address.get(id(call.function))
            if number is None:
                number = by_hash.setdefault(call.function.__hash__(), len(self.functions))
                by_address[id(call.function)] = number
                if number == len(self.functions):
                    self.functions.append(call.function)
            numbers.append(number)
        self.number: Ints = np.array(numbers, np.int64)
        self.inputs = Spans.of([call.inputs for call in calls])
        self.outputs = Spans.of([call.outputs for call in calls])
        self.accumulate: Bools = np.array([call.accumulate for call in calls], bool)

    def __len__(self) -> int:
        """Return the number of calls."""
        return len(self.calls)

    def by_function(self) -> Iterator[tuple[int, Ints]]:
        """Yield the number of each function, and its calls in order."""
        yield from enumerate(grouped(self.number, len(self.functions)))


def grouped(numbers: Ints, count: int) -> list[Ints]:
    """Return for each number below ``count`` its positions, in order."""
    order = np.argsort(numbers, kind="stable")
    ends = np.cumsum(np.bincount(numbers, minlength=count))
    return np.split(order, ends[:-1]) if count else []


def rows_of(spans: Spans, calls: Ints) -> Ints:
    """Return the positions (calls, places) of the places of calls of one function among those of all."""
    if not len(calls):
        return np.zeros((0, 0), np.int64)
    count = int(spans.starts[calls[0] + 1] - spans.starts[calls[0]])
    rows: Ints = spans.starts[calls][:, None] + np.arange(count)
    return rows
