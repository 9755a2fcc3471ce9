"""The adjoint of one call: from its arguments and the adjoints of its results to what is added to its arguments'."""

from __future__ import annotations

import casadi as ca

from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.instructions import graph_of
from symphys.codegen.graph.rewrite import with_reciprocals
from symphys.codegen.graph.sums import with_early_sums
from symphys.codegen.program.program import Function

Mask = tuple[bool, ...]


def adjoint_graph(function: Function, forward: Graph, inputs: Mask, outputs: Mask, tabled: bool = False) -> Graph:
    """Graph with the arguments, then the adjoints of the marked results; it gives one result a marked argument.

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
