"""Changes to adjoint graphs that make them cheaper: their last bits need not be casadi's."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from symphys.codegen.graph.graph import Graph, Node, made, ordered
from symphys.codegen.graph.operations import MASKS
from symphys.records import dataclass

Change = Callable[[Graph, int, Node], int]
"""(new graph, number of the old node, node with new operands) -> number of the new node"""


def rewritten(graph: Graph, into: Graph, change: Change) -> dict[int, int]:
    """Copy the needed nodes into another graph, each as ``change`` wants it; returns their new numbers."""
    numbers: dict[int, int] = {}
    moved = numbers.__getitem__
    for x in graph.needed():
        op, operands, at, value = graph.nodes[x]
        numbers[x] = change(into, x, made(op, ordered(op, tuple(map(moved, operands))), at, value))
    return numbers


def with_reciprocals(graph: Graph, forward: Graph) -> Graph:
    """Replace several divisions of adjoints by one value by products with its reciprocal.

    What the call itself computes, ``forward``, stays as it is, so that it need not be computed twice.
    """
    known = _found_in(graph, forward)
    divisions = {x for x in graph.needed() if graph.nodes[x].op == "div" and x not in known}
    divisors = Counter(graph.nodes[x].operands[1] for x in divisions)

    def change(new: Graph, x: int, node: Node) -> int:
        if x not in divisions or divisors[graph.nodes[x].operands[1]] < 2:
            return new.put(node)
        return new.add("mul", node.operands[0], new.add("div", new.constant(1.0), node.operands[1]))

    new = Graph(graph.sizes)
    numbers = rewritten(graph, new, change)
    new.results = [[numbers[x] for x in result] for result in graph.results]
    return new


def with_fused_products(graph: Graph, adds: bool) -> Graph:
    """Fuse products that are only added or subtracted with their sums into one rounding: fma, fms and fnma.

    Nodes keep their numbers. ``adds``: results are added to what is there, so that products among them are fused there.
    """
    needed = graph.needed()
    products = {x for x in needed if graph.nodes[x].op == "mul"}
    for x in needed:
        if graph.nodes[x].op not in ("add", "sub"):
            products.difference_update(graph.nodes[x].operands)
    if not adds:
        products.difference_update(x for result in graph.results for x in result)
    nodes = list(graph.nodes)
    for x in needed:
        if nodes[x].op in ("add", "sub"):
            first, second = nodes[x].operands
            kinds = ("fma", "fma") if nodes[x].op == "add" else ("fms", "fnma")
            if first in products:
                nodes[x] = Node(kinds[0], (*nodes[first].operands, second))
            elif second in products:
                nodes[x] = Node(kinds[1], (*nodes[second].operands, first))
    return Graph(graph.sizes, nodes, graph.results)


def fused_results(graph: Graph) -> set[int]:
    """Return products that only results have, after ``with_fused_products``: adding them is one rounding."""
    used = {y for x in graph.needed() for y in graph.nodes[x].operands}
    return {x for result in graph.results for x in result if graph.nodes[x].op == "mul" and x not in used}


def _found_in(graph: Graph, other: Graph) -> dict[int, int]:
    """Return the nodes that another graph has too, and their numbers there."""
    found: dict[int, int] = {}
    for x, (op, operands, at, value) in enumerate(graph.nodes):
        try:
            there = tuple(map(found.__getitem__, operands))
        except KeyError:
            continue
        number = other.numbers.get(made(op, ordered(op, there), at, value))
        if number is not None:
            found[x] = number
    return found


@dataclass(frozen=True)
class Taped:
    """A call's two functions, with values that the first stores and the second needs not compute again.

    Attributes:
        forward: has the tape as its last result.
        adjoint: has the tape as an argument between those of the call and the adjoints of its results.
        size: words of the tape.
    """

    forward: Graph
    adjoint: Graph
    size: int


def taped(forward: Graph, adjoint: Graph) -> Taped | None:
    """Put all that depends on the call's arguments only on a tape; None if there is nothing.

    A load costs less than any operation: storing divisions and roots only was slower, even where the tape of a step
    is larger than the second cache. Masks are computed again.
    """
    primal = len(forward.sizes)
    origins = adjoint.origins()
    kept = {
        x
        for x in adjoint.needed()
        if adjoint.nodes[x].op not in MASKS | {"input", "const"} and not origins[x] >> primal
    }
    leaves = _reached(adjoint, kept)
    if not leaves:
        return None
    slots = {x: slot for slot, x in enumerate(leaves)}

    def read(new: Graph, x: int, node: Node) -> int:
        if x in slots:
            return new.put(Node("input", at=(primal, slots[x])))
        if node.op == "input" and node.at[0] >= primal:
            return new.put(Node("input", at=(node.at[0] + 1, node.at[1])))
        return new.put(node)

    pull = Graph((*forward.sizes, len(slots), *adjoint.sizes[primal:]))
    numbers = rewritten(adjoint, pull, read)
    pull.results = [[numbers[x] for x in result] for result in adjoint.results]
    push = Graph(forward.sizes, list(forward.nodes), [*forward.results], dict(forward.numbers))
    numbers = rewritten(adjoint, push, lambda new, x, node: new.put(node))
    push.results.append([numbers[x] for x in leaves])
    return Taped(push, pull, len(slots))


def _reached(graph: Graph, stops: set[int]) -> list[int]:
    """Return the stops that results reach without passing another stop."""
    open_ = [x for result in graph.results for x in result]
    seen: set[int] = set()
    while open_:
        x = open_.pop()
        if x not in seen:
            seen.add(x)
            if x not in stops:
                open_ += graph.nodes[x].operands
    return sorted(seen & stops)
