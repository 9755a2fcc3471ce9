"""The adjoint of one call: from its arguments and the adjoints of its results to what is added to its arguments'.

An adjoint adds up what each use of a value gives it, one after the other. In a sweep each sum needs the one before it,
so that a processor waits for ten additions a row. Here terms are added as they come, in two sums that are added last.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import casadi as ca

from symphys.codegen.graph.graph import Graph, Node, made, ordered
from symphys.codegen.graph.instructions import graph_of
from symphys.codegen.graph.rewrite import rewritten, with_reciprocals
from symphys.codegen.program.program import Function

LATENCY = {"div": 13, "sqrt": 20}
"""Cycles until a result is there, about; of what is not listed ``DEFAULT_LATENCY``."""
DEFAULT_LATENCY = 4
MIN_GAIN = 2 * DEFAULT_LATENCY
"""Cycles that must be gained: two sums instead of one take an operation more."""
Term = tuple[int, int]
"""(1 or -1, node)"""


def with_early_sums(graph: Graph, primal: int) -> Graph:
    """Return the graph of an adjoint with its sums in that order; sums of arguments alone stay as they are.

    ``primal``: how many arguments are no adjoints.
    """
    origins, needed = graph.origins(), graph.needed()
    sums = {x for x in needed if graph.nodes[x].op in ("add", "sub") and origins[x] >> primal}
    uses = Counter(y for x in needed for y in graph.nodes[x].operands)
    uses.update(y for result in graph.results for y in result)
    within = {y for x in sums for y in graph.nodes[x].operands if y in sums and uses[y] == 1}
    new, ready = Graph(graph.sizes), list[int]()
    numbers: dict[int, int] = {}
    for x in needed:
        node = graph.nodes[x]
        if x in within:
            continue
        if x in sums:
            terms = [(sign, numbers[y]) for sign, y in _terms(graph, x, within)]
            numbers[x] = _summed(new, terms, _times(new, ready))
        else:
            operands = ordered(node.op, tuple(map(numbers.__getitem__, node.operands)))
            numbers[x] = new.put(made(node.op, operands, node.at, node.value))
    new.results = [[numbers[x] for x in result] for result in graph.results]
    last = Graph(graph.sizes)
    numbers = rewritten(new, last, lambda into, _, node: into.put(node))
    last.results = [[numbers[x] for x in result] for result in new.results]
    return last


def _terms(graph: Graph, root: int, within: set[int]) -> list[Term]:
    """Return the terms of a sum in the order of addition."""
    found: list[Term] = []
    open_ = [(1, root)]
    while open_:
        sign, x = open_.pop()
        if x != root and x not in within:
            found.append((sign, x))
            continue
        node = graph.nodes[x]
        first, second = node.operands
        open_ += [(-sign if node.op == "sub" else sign, second), (sign, first)]
    return found


def _times(graph: Graph, ready: list[int]) -> list[int]:
    """Return the latency of each node [cycles]; ``ready`` grows with the graph."""
    for node in graph.nodes[len(ready) :]:
        wait = 0 if node.op in ("input", "const") else LATENCY.get(node.op, DEFAULT_LATENCY)
        ready.append(wait + max((ready[y] for y in node.operands), default=0))
    return ready


def _summed(graph: Graph, terms: Sequence[Term], ready: Sequence[int]) -> int:
    """Return a node for the sum: as it was, or two sums of the early terms first, then the late ones."""
    early = sorted(terms, key=lambda term: ready[term[1]])
    at = [ready[x] for _, x in early]
    best, found = _chained([ready[x] for _, x in terms]) - MIN_GAIN, 0
    for count in range(len(terms), 3, -1):
        both = max(_chained(at[0:count:2]), _chained(at[1:count:2])) + DEFAULT_LATENCY
        time = _chained([both, *at[count:]])
        if time < best:
            best, found = time, count
    if not found:
        return _finished(graph, _added(graph, terms))
    halves = [_added(graph, early[k:found:2]) for k in (0, 1)]
    return _finished(graph, _added(graph, [*halves, *early[found:]]))


def _chained(at: Sequence[int]) -> int:
    """Return the latency of a sum whose terms are added one after the other [cycles]."""
    time = at[0]
    for each in at[1:]:
        time = max(time, each) + DEFAULT_LATENCY
    return time


def _added(graph: Graph, terms: Sequence[Term]) -> Term:
    """Return the sum of terms one after the other."""
    sign, x = terms[0]
    for other, y in terms[1:]:
        if sign == other:
            x = graph.put(Node("add", ordered("add", (x, y))))
        else:
            x = graph.put(Node("sub", (x, y) if sign > 0 else (y, x)))
            sign = 1
    return sign, x


def _finished(graph: Graph, term: Term) -> int:
    sign, x = term
    return x if sign > 0 else graph.put(Node("neg", (x,)))


Mask = tuple[bool, ...]


def adjoint_graph(function: Function, forward: Graph, inputs: Mask, outputs: Mask, tabled: bool = False) -> Graph:
    """Return a graph of the arguments, then the adjoints of the marked results; one result for each marked argument.

    ``forward`` is the function's own graph. ``tabled``: all slopes are computed, then multiplied with the adjoints:
    more to compute, but of it only the products depend on the adjoints.
    """
    arguments = [ca.SX.sym("x", function.numel_in(i)) for i in range(function.n_in())]
    results = function.call(arguments, True, False)
    seeds = [ca.SX.sym("s", r.numel()) for r, on in zip(results, outputs, strict=True) if on]
    wanted = [x for x, on in zip(arguments, inputs, strict=True) if on]
    values = ca.vertcat(*(r for r, on in zip(results, outputs, strict=True) if on))
    by, seed = ca.vertcat(*wanted), ca.vertcat(*seeds)
    adjoint = ca.mtimes(ca.cse(ca.jacobian(values, by)).T, seed) if tabled else ca.jtimes(values, by, seed, True)
    ends = [0]
    for x in wanted:
        ends.append(ends[-1] + x.numel())
    pieces = [ca.densify(piece) for piece in ca.vertsplit(ca.densify(adjoint), ends)]
    found = with_reciprocals(graph_of(ca.Function("adjoint", [*arguments, *seeds], pieces)), forward)
    return found if tabled else with_early_sums(found, len(arguments))
