"""What a Jacobian takes: all calls forward once for several points, then adjoints of blocks of rows, point by point.

The forward pass puts all that adjoints need of the values on a tape. What an adjoint reads of it is the same for all
rows, so its lanes are rows. A block of rows takes only the calls that reach one of its outputs, and rows that take the
same calls share a block. Calls that are without effect at a point are left out there.

Calls of one function that follow each other, such as sweeps, become fewer calls that do several at once. Sweeps all
read the same places, and the adjoint of each adds to the same words. One call of several adds once. Calls that may be
left out stay by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.alternatives import ALWAYS, NONE, entries_of, of_call, word_of
from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.emit.pieces import Form
from symphys.codegen.errors import ProgramError
from symphys.codegen.graph.activity import Activity, CallActivity
from symphys.codegen.graph.graph import Graph
from symphys.codegen.program.program import Function, FunctionCall, Place, Program
from symphys.codegen.slopes.places import AdjointPlaces, PointPlaces
from symphys.codegen.slopes.pulls import Pull, Pulls, sparsity
from symphys.types import Bools, Ints

MAX_MERGED_CALLS = 4
MIN_INSTRUCTIONS = 400
"""Instructions of a function below which its calls are left as they are."""
Key = tuple[int, int]


def merged(program: Program) -> list[FunctionCall]:
    """The calls of a program of one step, in order."""
    calls, found = list(program.calls), list[FunctionCall]()
    reads = np.zeros(program.size, np.int64)
    for call in calls:
        _count(reads, call.inputs, 1)
    _count(reads, list(program.outputs.values()), 1)
    known: dict[tuple[object, ...], Function] = {}
    for _, group in groupby(calls, key=lambda call: call.function.__hash__()):
        same = list(group)
        left_out = any(call.guard or call.section for call in same)
        if left_out or same[0].function.n_instructions() < MIN_INSTRUCTIONS or not _chained(same):
            found += same
            continue
        for first in range(0, len(same), MAX_MERGED_CALLS):
            found.append(_together(same[first : first + MAX_MERGED_CALLS], reads, known))
    return found


def _together(
    calls: Sequence[FunctionCall], reads: NDArray[np.int64], known: dict[tuple[object, ...], Function]
) -> FunctionCall:
    """One call that does all of these; ``reads``: by how many calls and outputs each word is read."""
    inside = np.zeros_like(reads)
    for call in calls:
        _count(inside, call.inputs, 1)
    made = {_key(place) for call in calls for place in call.outputs}
    inputs = dict.fromkeys(_key(place) for call in calls for place in call.inputs if _key(place) not in made)
    kept = [place for call in calls for place in call.outputs if (reads > inside)[_words(place)].any()]
    numbers = {key: i for i, key in enumerate([*inputs, *(_key(place) for call in calls for place in call.outputs)])}
    function = calls[0].function
    wiring = tuple(tuple(numbers[_key(place)] for place in call.inputs) for call in calls)
    pattern = (function.__hash__(), len(inputs), wiring, tuple(numbers[_key(place)] for place in kept))
    if pattern not in known:
        values = {key: ca.SX.sym("a", key[1]) for key in inputs}
        symbols = list(values.values())
        for call in calls:
            results = function.call([values[_key(place)] for place in call.inputs], True, False)
            values |= {_key(place): result for place, result in zip(call.outputs, results, strict=True)}
        known[pattern] = ca.Function(function.name(), symbols, [ca.densify(values[_key(place)]) for place in kept])
    return FunctionCall(known[pattern], tuple(Place(*key) for key in inputs), tuple(place.still() for place in kept))


def _chained(calls: Sequence[FunctionCall]) -> bool:
    """Whether each call reads what the one before gave."""
    return len(calls) > 1 and all(
        not {_key(place) for place in before.outputs}.isdisjoint(_key(place) for place in after.inputs)
        for before, after in pairwise(calls)
    )


def _key(place: Place) -> Key:
    return place.offset, place.size


def _words(place: Place) -> slice:
    return slice(place.offset, place.offset + place.size)


def _count(counts: NDArray[np.int64], places: Sequence[Place], more: int) -> None:
    for place in places:
        counts[_words(place)] += more


@dataclass(frozen=True)
class RowBlock:
    """Rows that are computed at once.

    Attributes:
        rows: their numbers.
        taken: (adjoints,) which of all adjoints they take.
        left: (k, 2) words of the adjoint memory, as (first, count), that these adjoints write and none of them reads.
            They are 0 where the values are finite, since nothing that a row depends on is left out.
    """

    rows: list[int]
    taken: Bools
    left: Ints


@dataclass(frozen=True)
class Adjoints:
    """All adjoints, from the last call to the first, and what is done where one is left out.

    Attributes:
        entries: of all, one after the other.
        calls: (adjoints + 1, 6) where each begins among the entries; the words of its section and of its guard, -1:
            none; where its copies for these two begin, and its uses.
        copies: (copies, 4) the cell of what is added to another place, or -1; the word where it begins, if it has none;
            that of the other place, or -1: it is only zeroed; size.
        uses: (uses, 2) cell and which of its places the adjoint reads.
        cells: (cells, 3) the two places, their size.
    """

    entries: Ints
    calls: Ints
    copies: Ints
    uses: Ints
    cells: Ints


@dataclass(frozen=True)
class SlopePlan:
    """What the compiler and the driver need.

    Attributes:
        functions: the C functions, in the order of their numbers.
        forward: entries of all calls, one after the other; see ``entries_of``.
        backward: all adjoints.
        blocks: of rows.
        tape: words after the program's own.
        read: (k, 4) what adjoints read of all these, one after the other in the memory of one point: first, count, and
            the words of a section and a guard, since that is not read where one of these is 0; -1: none.
        adjoints: words of the adjoint memory.
        seeds: (rows,) the word of the adjoint memory of each row.
        result: where the adjoint of z begins.
    """

    functions: tuple[tuple[Graph, Form], ...]
    forward: Ints
    backward: Adjoints
    blocks: list[RowBlock]
    tape: int
    read: Ints
    adjoints: int
    seeds: Ints
    result: int


def slope_plan(program: Program, output: str, lanes: int) -> SlopePlan:
    """Plan the Jacobian of an output by z; ProgramError for a program that goes more than one step."""
    if program.steps != 1 or any(call.accumulate for call in program.calls):
        raise ProgramError("slopes are of programs of one step, whose calls add to nothing")
    functions, target = DistinctFunctions(), program.outputs[output]
    calls = merged(program)
    first = _after_guards(calls)
    reaches = [CallActivity.of(call, 1, functions.dependence(call.function)) for call in calls]
    pulls = Pulls(Activity(program, [reaches, [], []], [target]), functions, program.size)
    found = [pulls.of(reach, k >= first) for k, reach in enumerate(reaches)]
    forward = [
        (_push(reach.call, pull, functions), of_call(reach.call) if k >= first else ALWAYS)
        for k, (reach, pull) in enumerate(zip(reaches, found, strict=True))
    ]
    backward = [pull for pull in reversed(found) if pull]
    places, values = AdjointPlaces(program, target, backward), PointPlaces()
    blocks = []
    adjoints = _adjoints(backward, places, values, functions)
    for rows, taken in row_blocks(program, target, backward, lanes, functions):
        left = _left(program, [pull for pull, on in zip(backward, taken, strict=True) if on])
        ranges = sorted({each for place in left for each in places.ranges(place)})
        blocks.append(RowBlock(rows, taken, table(ranges, 2)))
    return SlopePlan(
        tuple(functions.listed),
        np.array(entries_of(forward), np.int64),
        adjoints,
        blocks,
        pulls.end - program.size,
        table(values.read(), 4),
        places.size,
        np.array([places.of(target.offset + row, 1) for row in range(target.size)], np.int64),
        places.of(program.z.offset, program.z.size),
    )


def _after_guards(calls: Sequence[FunctionCall]) -> int:
    """Calls up to the last that computes a guard: they are not left out."""
    guards = {call.guard.offset for call in calls if call.guard is not None}
    computing = [k for k, call in enumerate(calls) if any(place.offset in guards for place in call.outputs)]
    return 1 + max(computing, default=NONE)


def _adjoints(
    backward: Sequence[Pull], places: AdjointPlaces, values: PointPlaces, functions: DistinctFunctions
) -> Adjoints:
    entries, calls, copies, uses = list[int](), list[list[int]](), list[list[int]](), list[list[int]]()
    for pull in backward:
        begin = len(entries)
        entries.extend(_entry(pull, places, values, functions))
        starts = list[int]()
        for alternative in pull.alternatives:
            starts.append(len(copies))
            for copy in alternative.copies if alternative else ():
                cell, _ = places.cell(copy.offset, copy.size)
                to = NONE if copy.source == NONE else places.of(copy.source, copy.size)
                if cell == NONE or cell != places.cell(copy.source, copy.size)[0]:
                    copies.append([cell, places.of(copy.offset, copy.size), to, copy.size])
        calls.append([begin, *map(word_of, pull.alternatives), *starts, len(uses)])
        cells = [places.cell(place.offset, place.size) for place in pull.marked("outputs")]
        uses.extend([number, parity] for number, parity in cells if number != NONE)
    calls.append([len(entries), NONE, NONE, len(copies), len(copies), len(uses)])
    cells_of = [[cell.first, cell.second, cell.members[0][1]] for cell in places.cells]
    return Adjoints(np.array(entries, np.int64), table(calls, 6), table(copies, 4), table(uses, 2), table(cells_of, 3))


def table(rows: Sequence[Sequence[int]], columns: int) -> Ints:
    """Return rows of numbers (k, columns), none too."""
    return np.array(rows, np.int64).reshape(-1, columns)


def _left(program: Program, pulls: Sequence[Pull]) -> list[Place]:
    """Places that these adjoints write, and do not read and zero; without that of z."""
    read = np.zeros(program.size, bool)
    read[program.z.offset : program.z.offset + program.z.size] = True
    for pull in pulls:
        for place in pull.marked("outputs"):
            read[place.offset : place.offset + place.size] = True
    written = dict.fromkeys(Place(place.offset, place.size) for pull in pulls for place in pull.marked("inputs"))
    return [place for place in written if not read[place.offset : place.offset + place.size].all()]


def _push(call: FunctionCall, pull: Pull | None, functions: DistinctFunctions) -> list[int]:
    form, places = Form(primal=len(call.inputs), adds=False), [*call.inputs, *call.outputs]
    if pull is None or pull.taped is None:
        return functions.entry(functions.forward(call.function), form, places)
    return functions.entry(pull.taped.forward, form, [*places, pull.tape])


def _entry(pull: Pull, places: AdjointPlaces, values: PointPlaces, functions: DistinctFunctions) -> list[int]:
    call, taped = pull.reach.call, pull.taped
    used = functions.arguments(taped.adjoint if taped else pull.graph)
    whole = enumerate([*call.inputs, *([pull.tape] if taped else [])])
    section, guard = map(word_of, pull.alternatives)
    primal = [Place(values.of(place, (section, guard)) if i in used else 0, place.size) for i, place in whole]
    form = Form(primal=len(primal), adds=True, backward=True, clears=True, shared=True)
    marked = [*pull.marked("outputs"), *pull.marked("inputs")]
    adjoints = [Place(places.of(place.offset, place.size), place.size) for place in marked]
    return functions.entry(taped.adjoint if taped else pull.graph, form, [*primal, *adjoints])


def row_blocks(
    program: Program, target: Place, backward: Sequence[Pull], lanes: int, functions: DistinctFunctions
) -> list[tuple[list[int], Bools]]:
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


def _taken(program: Program, target: Place, backward: Sequence[Pull], functions: DistinctFunctions) -> Bools:
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
            known[id(graph)] = sparsity(graph)
        on = np.concatenate(
            [np.full(place.size, mark) for place, mark in zip(reach.call.outputs, pull.outputs, strict=True)]
        )
        seeded = useful[:, outputs] * on
        found[:, i] = seeded.any(axis=1)
        useful[:, inputs] = np.maximum(useful[:, inputs], np.minimum(seeded @ known[id(graph)], 1))
    return found
