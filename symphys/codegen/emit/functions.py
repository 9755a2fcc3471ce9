"""The C functions of a program, each distinct one once, and the table entries that call them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.form import Form
from symphys.codegen.graph.graph import Graph, Instructions, Mask, Taped, taped
from symphys.codegen.graph.instructions import instructions_of
from symphys.codegen.program.program import Function, Place
from symphys.records import dataclass


@dataclass
class FunctionGraphs:
    """The graphs of a casadi Function and of its adjoints, which all plans share.

    Attributes:
        instructions: what they are made from.
        forward: its own graph.
    """

    instructions: Instructions
    forward: Graph
    _adjoints: dict[tuple[Mask, Mask, bool], Graph] = field(default_factory=dict)
    _taped: dict[int, Taped | None] = field(default_factory=dict)

    def adjoint(self, inputs: Mask, outputs: Mask, tabled: bool) -> Graph:
        """Return the adjoint graph for these arguments and results; ``tabled`` as in ``Instructions.adjoint``."""
        key = inputs, outputs, tabled
        if key not in self._adjoints:
            self._adjoints[key] = self.instructions.adjoint(*key)
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
        instructions = instructions_of(function)
        _KNOWN[function] = FunctionGraphs(instructions, instructions.graph())
    return _KNOWN[function]


@dataclass
class DistinctFunctions:
    """The functions to compile, in the order of their numbers, and the graphs of each casadi Function."""

    listed: list[tuple[Graph, Form]] = field(default_factory=list)
    _numbers: dict[tuple[bytes, Form], int] = field(default_factory=dict)
    _graphs: dict[int, FunctionGraphs] = field(default_factory=dict)
    _equal: dict[bytes, FunctionGraphs] = field(default_factory=dict)

    def entry(self, graph: Graph, form: Form, places: Sequence[Place]) -> list[int]:
        """Return the table entry of a call: number, length, then offset and stride of each place."""
        pairs = [x for place in places for x in (place.offset, place.stride)]
        return [self.number(graph, form), 2 + len(pairs), *pairs]

    def number(self, graph: Graph, form: Form) -> int:
        """Return the number of a function, a new one where it is met first."""
        key = (graph.key, form)
        if key not in self._numbers:
            self._numbers[key] = len(self.listed)
            self.listed.append((graph, form))
        return self._numbers[key]

    def forward(self, function: Function) -> Graph:
        """Return the graph of a function, the same of equal functions."""
        return self._of(function).forward

    def adjoint(self, function: Function, inputs: Mask, outputs: Mask, tabled: bool = False) -> Graph:
        """Return the adjoint graph for these arguments and results; ``tabled`` as in ``Instructions.adjoint``."""
        return self._of(function).adjoint(inputs, outputs, tabled)

    def taped(self, function: Function, adjoint: Graph) -> Taped | None:
        """Return a function and its adjoint with a tape between them; None if nothing is worth it."""
        return self._of(function).taped(adjoint)

    def dependence(self, function: Function) -> list[NDArray[np.bool_]]:
        """Return for each result the matrix (size, arguments) of dependencies."""
        return self._of(function).forward.dependence

    def _of(self, function: Function) -> FunctionGraphs:
        """Return the graphs of a function, which equal functions share."""
        identity = function.__hash__()
        if identity not in self._graphs:
            found = graphs_of(function)
            self._graphs[identity] = self._equal.setdefault(found.forward.key, found)
        return self._graphs[identity]
