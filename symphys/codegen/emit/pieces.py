"""Pieces of functions: graphs in order, cut where a compiler's register allocation would take too long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field
from itertools import groupby

from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.rewrite import fused_results, with_fused_products
from symphys.records import dataclass

MAX_STATEMENTS = 500
"""Statements in one C function, and copies of what is given: a compiler's time grows faster than its length."""

MIN_RUN = 8
"""Words in a row that are one constant are written by a loop: inputs that nothing sets fill thousands of them."""


@dataclass(frozen=True)
class Form:
    """The way in which a graph reads and writes the memory.

    Attributes:
        primal: how many of its arguments are places of the memory; the others are places of the adjoint memory.
        adds: results are added to what is there.
        backward: results go to the adjoint memory.
        clears: the adjoint arguments are zeroed when they have been read.
        shared: what it reads of the memory is one number for all lanes.
    """

    primal: int
    adds: bool
    backward: bool = False
    clears: bool = False
    shared: bool = False


@dataclass
class GraphPiece:
    """A run of nodes that becomes one C function.

    Attributes:
        nodes: what it computes, in order.
        slots: the values that a later piece than their own reads, and their words in the buffer between pieces.
        fused: products that are added to results in one rounding.
        targets: for a node, the words of results that it is: (result, first word, number of words).
    """

    nodes: list[int]
    slots: dict[int, int]
    fused: set[int]
    targets: dict[int, list[tuple[int, int, int]]] = field(default_factory=dict)

    def copied(self) -> list[int]:
        """Write the results that are arguments, after all computed ones."""
        return sorted(set(self.targets) - set(self.nodes))


@dataclass(frozen=True)
class Cut:
    """A graph, with fused products where it may have some, and its pieces."""

    graph: Graph
    pieces: list[GraphPiece]


def pieces_of(graph: Graph, form: Form, fuses: bool) -> Cut:
    """Cut a graph; ``fuses``: whether adjoints have fused products."""
    fused: set[int] = set()
    if form.backward and fuses:
        graph = with_fused_products(graph, form.adds)
        fused = fused_results(graph) if form.adds else fused
    return Cut(graph, _cut(graph, fused))


def _cut(graph: Graph, fused: set[int]) -> list[GraphPiece]:
    order = [x for x in graph.needed() if graph.nodes[x].op not in ("const", "input")]
    runs = [order[i : i + MAX_STATEMENTS] for i in range(0, len(order), MAX_STATEMENTS)] or [[]]
    home = {x: i for i, run in enumerate(runs) for x in run}
    crossing = sorted({y for x in order for y in graph.nodes[x].operands if home.get(y, home[x]) != home[x]})
    slots = {x: slot for slot, x in enumerate(crossing)}
    pieces = [GraphPiece(run, slots, fused) for run in runs]
    copied = 0
    for r, result in enumerate(graph.results):
        for x, first, count in _runs(graph, result):
            if x not in home and (copied := copied + 1) % MAX_STATEMENTS == 0:
                pieces.append(GraphPiece([], slots, fused))
            pieces[home.get(x, -1)].targets.setdefault(x, []).append((r, first, count))
    return pieces


def _runs(graph: Graph, result: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """Return (value, first word, number of words) of a result; many words of one constant are together."""
    first = 0
    for x, words in groupby(result):
        count = len(list(words))
        if graph.nodes[x].op == "const" and count >= MIN_RUN:
            yield x, first, count
        else:
            yield from ((x, word, 1) for word in range(first, first + count))
        first += count
