"""Which results of a function meet no other result in any of its calls: sums in them need not be stored at once."""

from __future__ import annotations

import numpy as np

from symphys.codegen.emit.planned import Plan
from symphys.types import Ints


def results_apart(planned: Plan, steps: int) -> list[set[int]]:
    """For each function; all of those of a function without calls."""
    calls: list[list[Ints]] = [[] for _ in planned.functions]
    for count, table in planned.tables.values():
        at = 0
        for _ in range(count):
            calls[int(table[at])].append(table[at + 2 : at + table[at + 1]].reshape(-1, 2))
            at += int(table[at + 1])
    found = []
    for (graph, _), own in zip(planned.functions, calls, strict=True):
        met: set[int] = set()
        sizes = [len(result) for result in graph.results]
        places = np.array([call[len(graph.sizes) :] for call in own]).reshape(len(own), len(sizes), 2)
        for a, b in zip(*np.triu_indices(len(sizes), 1), strict=True):
            if sizes[a] and sizes[b] and _meet(places[:, a], sizes[a], places[:, b], sizes[b], steps):
                met |= {int(a), int(b)}
        found.append(set(range(len(sizes))) - met)
    return found


def _meet(a: Ints, size: int, b: Ints, other: int, steps: int) -> bool:
    """Whether places, (calls, 2) offsets and strides, have a word in common in any step of any call."""
    offset, stride = (b - a).T
    ends = [offset, offset + stride * (steps - 1)]
    least, most = np.minimum(*ends), np.maximum(*ends)  # of the distance, over time: what lies between counts as met
    return bool(((least < size) & (most > -other)).any())
