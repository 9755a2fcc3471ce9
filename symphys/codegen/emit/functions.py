"""The C functions of a program, each distinct one once, and the table entries that call them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.pieces import Form
from symphys.codegen.graph.adjoint import Mask, adjoint_graph
from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.instructions import graph_of
from symphys.codegen.graph.rewrite import Taped, taped
from symphys.codegen.program.program import Function, Place
from symphys.records import dataclass

Key = tuple[object, ...]


@dataclass
class FunctionGraphs:
    """The graphs of a casadi Function and of its adjoints, which all plans share.

    Attributes:
        forward: its own graph.
    """

    forward: Graph
    _adjoints: dict[Key, Graph] = field(default_factory=dict)
    _taped: dict[int, Taped | None] = field(default_factory=dict)

    @cached_property
    def key(self) -> Key:
        """Equal for equal functions."""
        return self.forward.key()

    @cached_property
    def dependence(self) -> list[NDArray[np.bool_]]:
        """Return for each result the matrix (size, arguments) of dependencies."""
        bits, arguments = self.forward.origins(), range(len(self.forward.sizes))
        return [
            np.array([[bits[x] >> i & 1 for i in arguments] for x in result], dtype=bool).reshape(
                len(result), len(arguments)
            )
            for result in self.forward.results
        ]

    def adjoint(self, function: Function, inputs: Mask, outputs: Mask, tabled: bool) -> Graph:
        """Return the adjoint graph for these arguments and results; ``function``: this one or an equal one."""
        key = inputs, outputs, tabled
        if key not in self._adjoints:
            self._adjoints[key] = adjoint_graph(function, self.forward, inputs, outputs, tabled)
        return self._adjoints[key]

    def taped(self, adjoint: Graph) -> Taped | None:
        """Return the function and one of its adjoints with a tape between them; None if nothing is worth it."""
        if id(adjoint) not in self._taped:
            self._taped[id(adjoint)] = taped(self.forward, adjoint)
        return self._taped[id(adjoint)]


_KNOWN: WeakKeyDictionary[Function, FunctionGraphs] = WeakKeyDictionary()
"""The graphs of functions that are still in use: kernels of a rollout, of its steps and of their slopes share most."""


def graphs_of(function: Function) -> FunctionGraphs:
    """Return the graphs of a function."""
    if function not in _KNOWN:
        _KNOWN[function] = FunctionGraphs(graph_of(function))
    return _KNOWN[function]


@dataclass
class DistinctFunctions:
    """The functions to compile, in the order of their numbers, and the graphs of each casadi Function."""

    listed: list[tuple[Graph, Form]] = field(default_factory=list)
    _numbers: dict[Key, int] = field(default_factory=dict)
    _graphs: dict[int, FunctionGraphs] = field(default_factory=dict)
    _equal: dict[Key, FunctionGraphs] = field(default_factory=dict)
    _identities: dict[int, int] = field(default_factory=dict)
    _distinct: dict[Key, int] = field(default_factory=dict)
    _arguments: dict[int, frozenset[int]] = field(default_factory=dict)

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
        """Return the graph of a function, the same of equal functions."""
        return self._of(function).forward

    def adjoint(self, function: Function, inputs: Mask, outputs: Mask, tabled: bool = False) -> Graph:
        """Return the adjoint graph for these arguments and results; ``tabled``: as ``adjoint_graph`` has it."""
        return self._of(function).adjoint(function, inputs, outputs, tabled)

    def taped(self, function: Function, adjoint: Graph) -> Taped | None:
        """Return a function and its adjoint with a tape between them; None if nothing is worth it."""
        return self._of(function).taped(adjoint)

    def dependence(self, function: Function) -> list[NDArray[np.bool_]]:
        """Return for each result the matrix (size, arguments) of dependencies."""
        return self._of(function).dependence

    def arguments(self, graph: Graph) -> frozenset[int]:
        """Return the arguments that a graph reads."""
        if id(graph) not in self._arguments:
            self._arguments[id(graph)] = frozenset(graph.nodes[x].at[0] for x in graph.needed())
        return self._arguments[id(graph)]

    def _of(self, function: Function) -> FunctionGraphs:
        """Return the graphs of a function, which equal functions share."""
        identity = function.__hash__()
        if identity not in self._graphs:
            found = graphs_of(function)
            self._graphs[identity] = self._equal.setdefault(found.key, found)
        return self._graphs[identity]

    def _identity(self, graph: Graph) -> int:
        """Return a number that equal graphs share; graphs live as long as this object, so that addresses name them."""
        if id(graph) not in self._identities:
            self._identities[id(graph)] = self._distinct.setdefault(graph.key(), len(self._distinct))
        return self._identities[id(graph)]
