"""The adjoint of one call, for a block of rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.alternatives import ALWAYS, Alternatives, Span, of_adjoint
from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.graph.activity import Activity, CallActivity
from symphys.codegen.graph.adjoint import Mask
from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.rewrite import Taped
from symphys.codegen.program.program import Function, Place

TABLE_COST = 1.5
"""Operations of products with slopes on the tape that take as long as one of other adjoints, which store more."""
ALWAYS_TRIED = 100
"""Slopes of a call: so many are tried."""
COUNT_CORRECTION = 0.95
"""Of the operations that a slope is counted with: products with 1 are none. Measured in large calls: 0.99."""
MAX_SLOPES = 6000
"""Slopes of a call beyond which it is not asked whether a table of them is less."""


@dataclass
class Pull:
    """The adjoint of a call with respect to the marked arguments and results.

    Attributes:
        reach: the call.
        graph: its adjoint.
        inputs, outputs: the marks.
        taped: its functions with a tape; None: it needs none.
        tape: where that lies.
        alternatives: when it may be left out.
    """

    reach: CallActivity
    graph: Graph
    inputs: Mask
    outputs: Mask
    taped: Taped | None
    tape: Place
    alternatives: Alternatives = ALWAYS

    def marked(self, side: Literal["inputs", "outputs"]) -> list[Place]:
        """The places whose adjoints it writes, or reads and zeroes."""
        places, marks = getattr(self.reach.call, side), getattr(self, side)
        return [place for place, on in zip(places, marks, strict=True) if on and place.size]

    @property
    def work(self) -> int:
        """Operations of a block."""
        return _operations(self.graph, self.taped)


class Pulls:
    """Adjoints of the calls of a program, each with its tape after that of the one before.

    Attributes:
        end: words of the program and of the tapes.
    """

    def __init__(self, activity: Activity, functions: DistinctFunctions, size: int) -> None:
        """Start without pulls for a program of ``size`` words."""
        self.end = size
        self._activity, self._functions = activity, functions
        self._known = dict[tuple[int, Mask, Mask], tuple[Graph, Taped | None]]()

    def of(self, reach: CallActivity, left: bool) -> Pull | None:
        """The adjoint of a call; None if nothing that matters goes through it. ``left``: it may be left out."""
        inputs, outputs = self._activity.marks(reach.inputs), self._activity.marks(reach.outputs)
        if not any(inputs) or not any(outputs):
            return None
        key = id(self._functions.forward(reach.call.function)), inputs, outputs
        if key not in self._known:
            self._known[key] = _cheaper(reach.call.function, inputs, outputs, self._functions)
        graph, taped = self._known[key]
        found = Pull(reach, graph, inputs, outputs, taped, Place(self.end, taped.size if taped else 0))
        self.end += found.tape.size
        if left:
            results, arguments = (
                [Span(place.offset, place.stride, place.size) for place in found.marked(side)]
                for side in ("outputs", "inputs")
            )
            found.alternatives = of_adjoint(reach.call, results, arguments)
        return found


def sparsity(graph: Graph) -> NDArray[np.float32]:
    """(words of all results, words of all arguments): 1 where one depends on the other."""
    starts = np.cumsum([0, *graph.sizes]).tolist()
    bits: list[int] = []
    for node in graph.nodes:
        own = 1 << (starts[node.at[0]] + node.at[1]) if node.op == "input" else 0
        for x in node.operands:
            own |= bits[x]
        bits.append(own)
    rows = [bits[x].to_bytes(starts[-1] // 8 + 1, "little") for result in graph.results for x in result]
    flags = np.frombuffer(b"".join(rows), np.uint8).reshape(len(rows), -1)
    return np.unpackbits(flags, axis=1, count=starts[-1], bitorder="little").astype(np.float32)


def _operations(graph: Graph, taped: Taped | None) -> int:
    """Write the adjoint of a call for a block of rows."""
    found = taped.adjoint if taped else graph
    return sum(found.nodes[x].op not in ("input", "const") for x in found.needed())


def _cheaper(
    function: Function, inputs: Mask, outputs: Mask, functions: DistinctFunctions
) -> tuple[Graph, Taped | None]:
    """The adjoint that takes less for a block of rows: the function's own, or products with a table of its slopes."""
    forward = functions.forward(function)
    graph = functions.adjoint(function, inputs, outputs)
    taped = functions.taped(forward, graph)
    most, slopes = TABLE_COST * _operations(graph, taped), sparsity(forward)
    if slopes.sum() > MAX_SLOPES or _products(forward, slopes, inputs, outputs) > most:
        return graph, taped
    table = functions.adjoint(function, inputs, outputs, tabled=True)
    other = functions.taped(forward, table)
    return (table, other) if _operations(table, other) < most else (graph, taped)


def _products(forward: Graph, slopes: NDArray[np.float32], inputs: Mask, outputs: Mask) -> float:
    """Operations of products with a table of that many slopes, which takes long to make; 0 where it is soon made."""
    by = np.repeat(inputs, forward.sizes)
    of = np.repeat(outputs, [len(result) for result in forward.results])
    counts = slopes[of][:, by].sum(axis=0)
    return float(COUNT_CORRECTION * (counts + np.maximum(counts - 1, 0)).sum()) if counts.sum() > ALWAYS_TRIED else 0.0
