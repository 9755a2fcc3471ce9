"""The C functions of a program, each distinct one once, and the table entries that call them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.pieces import Form
from symphys.codegen.graph.adjoint import Mask, adjoint_graph
from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.instructions import graph_of
from symphys.codegen.graph.rewrite import Taped, taped
from symphys.codegen.program.program import Function, Place

Key = tuple[object, ...]


@dataclass
class DistinctFunctions:
    """The functions to compile, in the order of their numbers, and the graphs of each casadi Function."""

    listed: list[tuple[Graph, Form]] = field(default_factory=list)
    _numbers: dict[Key, int] = field(default_factory=dict)
    _forward: dict[int, Graph] = field(default_factory=dict)
    _identities: dict[int, int] = field(default_factory=dict)
    _distinct: dict[Key, int] = field(default_factory=dict)
    _adjoints: dict[Key, Graph] = field(default_factory=dict)
    _taped: dict[tuple[int, int], Taped | None] = field(default_factory=dict)
    _arguments: dict[int, frozenset[int]] = field(default_factory=dict)
    _dependences: dict[int, list[NDArray[np.bool_]]] = field(default_factory=dict)

    def entry(self, graph: Graph, form: Form, places: Sequence[Place]) -> list[int]:
        """Return the table entry of a call: number, length, then offset and stride of each place."""
        pairs = [x for place in places for x in (place.offset, place.stride)]
        return [self.number(graph, form), 2 + len(pairs), *pairs]

    def number(self, graph: Graph, form: Form) -> int:
        """Return the number of a function, a new one where it is met first."""
        key = (self._identity(graph), form)
        if key not in self._numbers:
            self._numbers[key] = len(self.listed)
            self.listed.append((graph, form))
        return self._numbers[key]

    def forward(self, function: Function) -> Graph:
        """Return the graph of a function."""
        identity = function.__hash__()
        if identity not in self._forward:
            self._forward[identity] = graph_of(function)
        return self._forward[identity]

    def adjoint(self, function: Function, inputs: Mask, outputs: Mask, tabled: bool = False) -> Graph:
        """Return the adjoint graph for these arguments and results; ``tabled``: as ``adjoint_graph`` has it."""
        forward = self.forward(function)
        key = (self._identity(forward), inputs, outputs, tabled)
        if key not in self._adjoints:
            self._adjoints[key] = adjoint_graph(function, forward, inputs, outputs, tabled)
        return self._adjoints[key]

    def taped(self, forward: Graph, adjoint: Graph) -> Taped | None:
        """Return the two with a tape between them; None if nothing is worth it."""
        key = (id(forward), id(adjoint))
        if key not in self._taped:
            self._taped[key] = taped(forward, adjoint)
        return self._taped[key]

    def dependence(self, function: Function) -> list[NDArray[np.bool_]]:
        """Return for each result the matrix (size, arguments) of dependencies."""
        graph = self.forward(function)
        if id(graph) not in self._dependences:
            bits, arguments = graph.origins(), range(len(graph.sizes))
            self._dependences[id(graph)] = [
                np.array([[bits[x] >> i & 1 for i in arguments] for x in result], dtype=bool).reshape(
                    len(result), len(arguments)
                )
                for result in graph.results
            ]
        return self._dependences[id(graph)]

    def arguments(self, graph: Graph) -> frozenset[int]:
        """Return the arguments that a graph reads."""
        if id(graph) not in self._arguments:
            self._arguments[id(graph)] = frozenset(graph.nodes[x].at[0] for x in graph.needed())
        return self._arguments[id(graph)]

    def _identity(self, graph: Graph) -> int:
        """Return a number that equal graphs share; graphs live as long as this object, so that addresses name them."""
        if id(graph) not in self._identities:
            self._identities[id(graph)] = self._distinct.setdefault(graph.key(), len(self._distinct))
        return self._identities[id(graph)]
