"""Graphs from the instructions of SX Functions.

fmin and fmax let a NaN through, unlike those of C and casadi: a NaN must be seen, not clamped away. With a constant
operand that costs nothing.
"""

from __future__ import annotations

import casadi as ca

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.graph.graph import Graph, Node
from symphys.codegen.graph.operations import NAMES
from symphys.codegen.program.program import Function


def graph_of(function: Function) -> Graph:
    """Return the graph of a function; KernelUnavailable if an operation has no counterpart."""
    graph = Graph(tuple(function.numel_in(i) for i in range(function.n_in())))
    graph.results = [[-1] * function.numel_out(i) for i in range(function.n_out())]
    work: dict[int, int] = {}
    for i in range(function.n_instructions()):
        op, operands, target = (
            function.instruction_id(i),
            function.instruction_input(i),
            function.instruction_output(i),
        )
        if op == ca.OP_OUTPUT:
            graph.results[target[0]][target[1]] = graph.number(work[operands[0]])
        elif op == ca.OP_INPUT:
            work[target[0]] = graph.put(Node("input", at=(operands[0], operands[1])))
        elif op == ca.OP_CONST:
            work[target[0]] = graph.constant(function.instruction_constant(i))
        else:
            work[target[0]] = _translate(graph, op, [work[x] for x in operands])
    return graph


def _translate(graph: Graph, op: int, x: list[int]) -> int:
    if op in NAMES:
        return graph.add(NAMES[op], *x)
    if op in (ca.OP_FMIN, ca.OP_FMAX):
        return _extreme(graph, op == ca.OP_FMIN, graph.number(x[0]), graph.number(x[1]))
    zero, one = graph.constant(0.0), graph.constant(1.0)
    match op:
        case ca.OP_SQ:
            return graph.add("mul", x[0], x[0])
        case ca.OP_TWICE:
            return graph.add("add", x[0], x[0])
        case ca.OP_INV:
            return graph.add("div", one, x[0])
        case ca.OP_FABS:
            return graph.add("fabs", x[0])
        case ca.OP_ASSIGN | ca.OP_LIFT:
            return x[0]
        case ca.OP_SIGN:
            negative = graph.add("select", graph.add("lt", x[0], zero), graph.constant(-1.0), x[0])
            return graph.add("select", graph.add("lt", zero, x[0]), one, negative)
    raise KernelUnavailable(f"casadi operation {op} has no counterpart in compiled kernels; use casadi's evaluation")


def _extreme(graph: Graph, smaller: bool, a: int, b: int) -> int:
    if graph.nodes[b].op == "const":
        a, b = b, a
    before = graph.add("lt", a, b) if smaller else graph.add("lt", b, a)
    if graph.nodes[a].op != "const":
        before = graph.add("or", before, graph.add("ne", a, a))
    return graph.add("select", before, a, b)
