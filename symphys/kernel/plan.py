"""From a program to what is compiled, each distinct function once, and to the tables that the driver walks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from symphys.kernel.activity import Activity, Reach
from symphys.kernel.adjoint import Mask, adjoint_graph
from symphys.kernel.graph import Graph
from symphys.kernel.instructions import graph_of
from symphys.kernel.program import Call, Function, Place, Program
from symphys.kernel.writer import Form

Table = NDArray[np.int64]


@dataclass(frozen=True)
class Plan:
    """What the compiler and the driver need.

    Attributes:
        functions: the C functions, in the order of their numbers.
        tables: for each phase the number of calls and their entries.
    """

    functions: tuple[tuple[Graph, Form], ...]
    tables: dict[str, tuple[int, Table]]


def plan(program: Program, seeded: Sequence[str]) -> Plan:
    """Plan the forward pass and the gradient with respect to z of the seeded outputs."""
    library = _Library()
    phases = [program.prologue, program.body, program.epilogue]
    reaches = [
        [library.reach(call, program.steps if phase is program.body else 1) for call in phase] for phase in phases
    ]
    activity = Activity(program, reaches, [program.outputs[name] for name in seeded])
    back = [[pull for reach in reversed(phase) if (pull := library.pull(reach, activity))] for phase in reaches]
    tables = dict(zip(("prologue", "body", "epilogue"), ([library.push(c) for c in p] for p in phases), strict=True))
    tables |= dict(
        zip(("back_prologue", "back_body", "back_epilogue"), ([p.entry for p in b] for b in back), strict=True)
    )
    tables["again"] = [library.push(call) for call in _again(program, reaches[1], back[1])]
    return Plan(tuple(library.functions), {name: (len(rows), _flat(rows)) for name, rows in tables.items()})


@dataclass(frozen=True)
class _Pull:
    """An adjoint call: its table entry, and the words of the memory that it reads."""

    entry: list[int]
    reads: list[NDArray[np.int64]]


@dataclass
class _Library:
    """The C functions so far, and what is known about each casadi Function."""

    functions: list[tuple[Graph, Form]] = field(default_factory=list)
    numbers: dict[object, int] = field(default_factory=dict)
    graphs: dict[object, Graph] = field(default_factory=dict)
    dependences: dict[int, list[NDArray[np.bool_]]] = field(default_factory=dict)

    def reach(self, call: Call, steps: int) -> Reach:
        inputs = [place.words(steps) for place in call.inputs]
        outputs = [place.words(steps) for place in call.outputs]
        return Reach(call, inputs, outputs, self._dependence(call.function))

    def push(self, call: Call) -> list[int]:
        form = Form(primal=len(call.inputs), adds=call.accumulate)
        return _entry(self._number(self._forward(call.function), form), [*call.inputs, *call.outputs])

    def pull(self, reach: Reach, activity: Activity) -> _Pull | None:
        call = reach.call
        inputs, outputs = activity.marks(reach.inputs), activity.marks(reach.outputs)
        if not any(inputs) or not any(outputs):
            return None
        graph = self._adjoint(call.function, inputs, outputs)
        form = Form(primal=len(inputs), adds=True, backward=True, clears=not call.accumulate)
        places = [*call.inputs, *_marked(call.outputs, outputs), *_marked(call.inputs, inputs)]
        used = {graph.nodes[x].at[0] for x in graph.needed() if graph.nodes[x].op == "input"}
        reads = [words for i, words in enumerate(reach.inputs) if i in used]
        return _Pull(_entry(self._number(graph, form), places), reads)

    def _number(self, graph: Graph, form: Form) -> int:
        key = (id(graph), form)
        if key not in self.numbers:
            self.numbers[key] = self.numbers.setdefault((graph.key(), form), len(self.functions))
            if self.numbers[key] == len(self.functions):
                self.functions.append((graph, form))
        return self.numbers[key]

    def _forward(self, function: Function) -> Graph:
        key = function.__hash__()
        if key not in self.graphs:
            self.graphs[key] = graph_of(function)
        return self.graphs[key]

    def _adjoint(self, function: Function, inputs: Mask, outputs: Mask) -> Graph:
        key = (self._forward(function).key(), inputs, outputs)
        if key not in self.graphs:
            self.graphs[key] = adjoint_graph(function, inputs, outputs)
        return self.graphs[key]

    def _dependence(self, function: Function) -> list[NDArray[np.bool_]]:
        graph = self._forward(function)
        if id(graph) not in self.dependences:
            bits, arguments = graph.origins(), range(len(graph.sizes))
            self.dependences[id(graph)] = [
                np.array([[bits[x] >> i & 1 for i in arguments] for x in result], dtype=bool).reshape(len(result), -1)
                for result in graph.results
            ]
        return self.dependences[id(graph)]


def _again(program: Program, body: Sequence[Reach], pulls: Iterable[_Pull]) -> list[Call]:
    """The calls that must be run again before the adjoints of a step: those whose scratch is read."""
    scratch = program.scratch()
    needed = np.zeros(program.size, dtype=bool)
    for pull in pulls:
        for words in pull.reads:
            needed[words] = True
    needed &= scratch
    chosen = []
    for reach in reversed(body):
        if any(needed[words].any() for words in reach.outputs):
            chosen.append(reach.call)
            for words in reach.inputs:
                needed[words] |= scratch[words]
    return chosen[::-1]


def _marked(places: Sequence[Place], marks: Mask) -> list[Place]:
    return [place for place, on in zip(places, marks, strict=True) if on]


def _entry(number: int, places: Sequence[Place]) -> list[int]:
    pairs = [x for place in places for x in (place.offset, place.stride)]
    return [number, 2 + len(pairs), *pairs]


def _flat(rows: Sequence[Sequence[int]]) -> Table:
    return np.array([x for row in rows for x in row] or [0], dtype=np.int64)
