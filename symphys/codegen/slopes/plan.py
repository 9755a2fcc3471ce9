"""What a Jacobian takes: all calls forward once for several points, then adjoints of blocks of rows, point by point.

The forward pass puts all that adjoints need of the values on a tape. What an adjoint reads of it is the same for all
rows, so its lanes are rows. A block of rows takes only the calls that reach one of its outputs, and rows that take the
same calls share a block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.emit.pieces import Form
from symphys.codegen.errors import ProgramError
from symphys.codegen.graph.activity import Activity, CallActivity
from symphys.codegen.graph.adjoint import Mask
from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.rewrite import Taped
from symphys.codegen.program.program import Function, FunctionCall, Place, Program
from symphys.codegen.slopes.merging import merged

Flags = NDArray[np.bool_]
Words = NDArray[np.int64]
TABLED = 1.5
"""Operations of products with slopes on the tape that take as long as one of other adjoints, which store more."""
LARGEST = 6000
"""Slopes of a call beyond which it is not asked whether a table of them is less."""


@dataclass(frozen=True)
class RowBlock:
    """Rows that are computed at once.

    Attributes:
        rows: their numbers.
        entries: table entries of the adjoints that they take.
        left: words of the adjoint memory, as (first, count), that these adjoints write and none of them reads. They are
            0 where the values are finite, since nothing that a row depends on is left out.
    """

    rows: list[int]
    entries: list[list[int]]
    left: list[tuple[int, int]]


@dataclass(frozen=True)
class SlopePlan:
    """What the compiler and the driver need.

    Attributes:
        functions: the C functions, in the order of their numbers.
        forward: table entries of all calls.
        blocks: of rows.
        tape: words after the program's own.
        read: what adjoints read of all these, as (first, count), one after the other in the memory of one point.
        adjoints: words of the adjoint memory.
        seeds: (rows,) the word of the adjoint memory of each row.
        result: where the adjoint of z begins.
    """

    functions: tuple[tuple[Graph, Form], ...]
    forward: list[list[int]]
    blocks: list[RowBlock]
    tape: int
    read: list[tuple[int, int]]
    adjoints: int
    seeds: list[int]
    result: int


@dataclass
class _Pull:
    """The adjoint of a call with respect to the marked arguments and results."""

    reach: CallActivity
    graph: Graph
    inputs: Mask
    outputs: Mask
    taped: Taped | None
    tape: Place

    def marked(self, side: Literal["inputs", "outputs"]) -> list[Place]:
        """The places whose adjoints it writes, or reads and zeroes."""
        places, marks = getattr(self.reach.call, side), getattr(self, side)
        return [place for place, on in zip(places, marks, strict=True) if on and place.size]

    @property
    def work(self) -> int:
        """Operations of a block."""
        return operations(self.graph, self.taped)


def operations(graph: Graph, taped: Taped | None) -> int:
    """Of an adjoint, for a block of rows."""
    found = taped.adjoint if taped else graph
    return sum(found.nodes[x].op not in ("input", "const") for x in found.needed())


def slope_plan(program: Program, output: str, lanes: int) -> SlopePlan:
    """Plan the Jacobian of an output by z; ProgramError for a program that goes more than one step."""
    if program.steps != 1 or any(call.accumulate for call in program.calls):
        raise ProgramError("slopes are of programs of one step, whose calls add to nothing")
    functions, target = DistinctFunctions(), program.outputs[output]
    reaches = [_reach(call, functions) for call in merged(program)]
    activity = Activity(program, [reaches, [], []], [target])
    pulls, end, known = list[_Pull | None](), program.size, dict[tuple[int, Mask, Mask], tuple[Graph, Taped | None]]()
    for reach in reaches:
        pull = _pull(reach, activity, functions, end, known)
        end += pull.tape.size if pull else 0
        pulls.append(pull)
    forward = [_push(reach.call, pull, functions) for reach, pull in zip(reaches, pulls, strict=True)]
    backward = [pull for pull in reversed(pulls) if pull]
    places = AdjointPlaces(program, target, backward)
    values = PointPlaces()
    entries = [_entry(pull, places, values, functions) for pull in backward]
    blocks = []
    for rows, taken in row_blocks(program, target, backward, lanes, functions):
        mine = [i for i, on in enumerate(taken) if on]
        left = _left(program, [backward[i] for i in mine])
        blocks.append(RowBlock(rows, [entries[i] for i in mine], [(places.of(place), place.size) for place in left]))
    seeds = [places.static[target.offset + row] for row in range(target.size)]
    result = places.static[program.z.offset] if program.z.size else 0
    return SlopePlan(
        tuple(functions.listed), forward, blocks, end - program.size, values.read, places.size, seeds, result
    )


def _left(program: Program, pulls: Sequence[_Pull]) -> list[Place]:
    """Places that these adjoints write, and do not read and zero; without that of z."""
    read = np.zeros(program.size, bool)
    read[program.z.offset : program.z.offset + program.z.size] = True
    for pull in pulls:
        for place in pull.marked("outputs"):
            read[place.offset : place.offset + place.size] = True
    written = dict.fromkeys(Place(place.offset, place.size) for pull in pulls for place in pull.marked("inputs"))
    return [place for place in written if not read[place.offset : place.offset + place.size].all()]


def _reach(call: FunctionCall, functions: DistinctFunctions) -> CallActivity:
    return CallActivity.of(call, 1, functions.dependence(call.function))


def _cheaper(
    function: Function, inputs: Mask, outputs: Mask, functions: DistinctFunctions
) -> tuple[Graph, Taped | None]:
    """The adjoint that takes less for a block of rows: the function's own, or products with a table of its slopes."""
    forward = functions.forward(function)
    graph = functions.adjoint(function, inputs, outputs)
    taped = functions.taped(forward, graph)
    if _sparsity(forward).sum() > LARGEST:
        return graph, taped
    table = functions.adjoint(function, inputs, outputs, tabled=True)
    other = functions.taped(forward, table)
    less = operations(table, other) < TABLED * operations(graph, taped)
    return (table, other) if less else (graph, taped)


def _pull(
    reach: CallActivity,
    activity: Activity,
    functions: DistinctFunctions,
    end: int,
    known: dict[tuple[int, Mask, Mask], tuple[Graph, Taped | None]],
) -> _Pull | None:
    """The adjoint of a call, with its tape at ``end``; None if nothing that matters goes through it."""
    inputs, outputs = activity.marks(reach.inputs), activity.marks(reach.outputs)
    if not any(inputs) or not any(outputs):
        return None
    key = id(functions.forward(reach.call.function)), inputs, outputs
    if key not in known:
        known[key] = _cheaper(reach.call.function, inputs, outputs, functions)
    graph, taped = known[key]
    return _Pull(reach, graph, inputs, outputs, taped, Place(end, taped.size if taped else 0))


def _push(call: FunctionCall, pull: _Pull | None, functions: DistinctFunctions) -> list[int]:
    form, places = Form(primal=len(call.inputs), adds=False), [*call.inputs, *call.outputs]
    if pull is None or pull.taped is None:
        return functions.entry(functions.forward(call.function), form, places)
    return functions.entry(pull.taped.forward, form, [*places, pull.tape])


def _entry(pull: _Pull, places: AdjointPlaces, values: PointPlaces, functions: DistinctFunctions) -> list[int]:
    call, taped = pull.reach.call, pull.taped
    used = functions.arguments(taped.adjoint if taped else pull.graph)
    whole = enumerate([*call.inputs, *([pull.tape] if taped else [])])
    primal = [Place(values.of(place) if i in used else 0, place.size) for i, place in whole]
    form = Form(primal=len(primal), adds=True, backward=True, clears=True, shared=True)
    marked = [*pull.marked("outputs"), *pull.marked("inputs")]
    adjoints = [Place(places.of(place), place.size) for place in marked]
    return functions.entry(taped.adjoint if taped else pull.graph, form, [*primal, *adjoints])


class PointPlaces:
    """Where the values of one point lie that adjoints read: in the order in which they read them."""

    def __init__(self) -> None:
        """Nothing is read yet."""
        self.read: list[tuple[int, int]] = []
        self._found: dict[tuple[int, int], int] = {}
        self._size = 0

    def of(self, place: Place) -> int:
        """The first word of a place."""
        key = place.offset, place.size
        if key not in self._found:
            self._found[key] = self._size
            self._size += place.size
            self.read.append(key)
        return self._found[key]


class AdjointPlaces:
    """Where adjoints lie: those that are not needed at the same time share words, so that all stay in fast memory.

    A result that calls read as a whole lives from the adjoint of its last reader to that of its writer, which leaves it
    zeroed. All other words have places of their own.
    """

    def __init__(self, program: Program, target: Place, backward: Sequence[_Pull]) -> None:
        """Hand out the words; ``backward`` in the order in which adjoints are computed."""
        read, written = dict[tuple[int, int], int](), dict[tuple[int, int], int]()
        parts: Words = np.zeros(program.size, np.int64)
        for i, pull in enumerate(backward):
            for place in pull.marked("inputs"):
                read.setdefault((place.offset, place.size), i)
            for place in pull.marked("outputs"):
                written[place.offset, place.size] = i
        for offset, size in {*read, *written}:
            parts[offset : offset + size] += 1
        fixed = np.zeros(program.size, bool)
        for place in (target, program.z):
            fixed[place.offset : place.offset + place.size] = True
        whole = {
            key: (read[key], written[key])
            for key in read
            if key in written and (parts[key[0] : sum(key)] == 1).all() and not fixed[key[0] : sum(key)].any()
        }
        self._shared = dict[tuple[int, int], int]()
        rest = fixed | (parts > 0)
        for offset, size in whole:
            rest[offset : offset + size] = False
        self.static = {int(word): i for i, word in enumerate(np.flatnonzero(rest))}
        self.size = len(self.static)
        self._share(whole)

    def _share(self, whole: dict[tuple[int, int], tuple[int, int]]) -> None:
        free: dict[int, list[tuple[int, int]]] = {}
        for key, (first, last) in sorted(whole.items(), key=lambda item: item[1]):
            same = free.setdefault(key[1], [])
            index = next((i for i, (_, until) in enumerate(same) if until < first), None)
            at = same.pop(index)[0] if index is not None else self.size
            self.size += key[1] if index is None else 0
            same.append((at, last))
            self._shared[key] = at

    def of(self, place: Place) -> int:
        """The first word of a place."""
        if not place.size:
            return 0
        shared = self._shared.get((place.offset, place.size))
        return self.static[place.offset] if shared is None else shared


def row_blocks(
    program: Program, target: Place, backward: Sequence[_Pull], lanes: int, functions: DistinctFunctions
) -> list[tuple[list[int], Flags]]:
    """Rows in blocks, and which of the adjoints each block takes: each row beside those with which it shares most."""
    taken = _taken(program, target, backward, functions)
    work = np.array([pull.work for pull in backward], float)
    left, blocks = list(range(target.size)), []
    while left:
        rows = [left.pop(int(np.argmax(taken[left] @ work)))]
        union = taken[rows[0]].copy()
        while left and len(rows) < lanes:
            rows.append(left.pop(int(np.argmax(taken[left] @ np.where(union, work, -work)))))
            union |= taken[rows[-1]]
        blocks.append((rows, union))
    return blocks


def _taken(program: Program, target: Place, backward: Sequence[_Pull], functions: DistinctFunctions) -> Flags:
    """(rows, adjoints): which adjoints a seed on each word of the output reaches."""
    useful = np.zeros((target.size, program.size), np.float32)
    useful[:, target.offset : target.offset + target.size] = np.eye(target.size)
    found, known = np.zeros((target.size, len(backward)), bool), dict[int, NDArray[np.float32]]()
    for i, pull in enumerate(backward):
        reach = pull.reach
        outputs = np.concatenate([place.words(1)[0] for place in reach.call.outputs])
        inputs = np.concatenate([place.words(1)[0] for place in reach.call.inputs])
        graph = functions.forward(reach.call.function)
        if id(graph) not in known:
            known[id(graph)] = _sparsity(graph)
        on = np.concatenate(
            [np.full(place.size, mark) for place, mark in zip(reach.call.outputs, pull.outputs, strict=True)]
        )
        seeded = useful[:, outputs] * on
        found[:, i] = seeded.any(axis=1)
        useful[:, inputs] = np.maximum(useful[:, inputs], np.minimum(seeded @ known[id(graph)], 1))
    return found


def _sparsity(graph: Graph) -> NDArray[np.float32]:
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
