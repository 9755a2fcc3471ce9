"""The plan of a Jacobian: calls forward once for several points, then adjoints of blocks of rows, point by point.

The forward pass puts all that adjoints need of the values on a tape. What an adjoint reads of it is the same for all
rows, so its lanes are rows. A block of rows takes only the calls that reach one of its outputs, and rows that take the
same calls share a block. Calls that are without effect at a point are left out there.

Calls of one function that follow each other, such as sweeps, become fewer calls that do several at once. Sweeps all
read the same places, and the adjoint of each adds to the same words. One call of several adds once. Calls that may be
left out stay by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import groupby, pairwise
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.alternatives import ALWAYS, NONE, Alternatives, Span, entries_of, of_adjoint, of_call, word_of
from symphys.codegen.emit.form import Form
from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.errors import ProgramError
from symphys.codegen.graph.activity import Activity, CallActivity
from symphys.codegen.graph.graph import Graph, Mask, Taped
from symphys.codegen.program.program import Function, FunctionCall, Place, Program
from symphys.records import dataclass
from symphys.types import Bools, Ints

MAX_MERGED_CALLS = 4
MIN_INSTRUCTIONS = 400
"""Instructions of a function below which its calls are left as they are."""
TABLE_COST = 1.5
"""Operations of products with slopes on the tape that take as long as one of other adjoints, which store more."""
ALWAYS_TRIED = 100
"""Slopes of a call: so many are tried."""
COUNT_CORRECTION = 0.95
"""Correction of the operations counted for a slope: products with 1 are none. Measured in large calls: 0.99."""
MAX_SLOPES = 6000
"""Slopes of a call beyond which it is not asked whether a table of them is less."""
MAX_TABLE_OPERATIONS = 20_000
"""Operations that make a table, beyond which compiling them takes longer than a table saves."""


Key = tuple[int, int]
"""Offset and size of a place."""


@dataclass
class Pull:
    """The adjoint of a call with respect to the marked arguments and results.

    Attributes:
        reach: the call.
        graph: its adjoint.
        inputs, outputs: the marks.
        taped: its functions with a tape; None: it needs none.
        tape: where that lies.
        alternatives: when it may be left out.
    """

    reach: CallActivity
    graph: Graph
    inputs: Mask
    outputs: Mask
    taped: Taped | None
    tape: Place
    alternatives: Alternatives = ALWAYS

    @cached_property
    def written(self) -> list[Key]:
        """The places whose adjoints it writes."""
        return [_key(place) for place in self.marked("inputs")]

    def marked(self, side: Literal["inputs", "outputs"]) -> list[Place]:
        """Return the places whose adjoints it writes, or reads and zeroes."""
        places, marks = getattr(self.reach.call, side), getattr(self, side)
        return [place for place, on in zip(places, marks, strict=True) if on and place.size]

    @property
    def work(self) -> int:
        """Return operations of a block."""
        return _operations(self.graph, self.taped)


class Pulls:
    """Adjoints of the calls of a program, each with its tape after that of the one before.

    Attributes:
        end: words of the program and of the tapes.
    """

    def __init__(self, activity: Activity, functions: DistinctFunctions, size: int) -> None:
        """Start without pulls for a program of ``size`` words."""
        self.end = size
        self._activity, self._functions = activity, functions
        self._known = dict[tuple[int, Mask, Mask], tuple[Graph, Taped | None]]()

    def of(self, reach: CallActivity, left: bool) -> Pull | None:
        """Return the adjoint of a call; None if nothing that matters goes through it. ``left``: it may be left out."""
        inputs, outputs = self._activity.marks(reach.inputs), self._activity.marks(reach.outputs)
        if not any(inputs) or not any(outputs):
            return None
        key = id(self._functions.forward(reach.call.function)), inputs, outputs
        if key not in self._known:
            self._known[key] = _cheaper(reach.call.function, inputs, outputs, self._functions)
        graph, taped = self._known[key]
        found = Pull(reach, graph, inputs, outputs, taped, Place(self.end, taped.size if taped else 0))
        self.end += found.tape.size
        if left:
            results, arguments = (
                [Span(place.offset, place.stride, place.size) for place in found.marked(side)]
                for side in ("outputs", "inputs")
            )
            found.alternatives = of_adjoint(reach.call, results, arguments)
        return found


def _operations(graph: Graph, taped: Taped | None) -> int:
    """Return the operations of the adjoint of a call for a block of rows."""
    return (taped.adjoint if taped else graph).operations


def _cheaper(
    function: Function, inputs: Mask, outputs: Mask, functions: DistinctFunctions
) -> tuple[Graph, Taped | None]:
    """Return the cheaper adjoint for a block of rows: the function's own, or products with a table of its slopes."""
    forward = functions.forward(function)
    graph = functions.adjoint(function, inputs, outputs)
    taped = functions.taped(function, graph)
    most, slopes = TABLE_COST * _operations(graph, taped), forward.sparsity()
    if slopes.sum() > MAX_SLOPES or _products(forward, slopes, inputs, outputs) > most:
        return graph, taped
    table = functions.adjoint(function, inputs, outputs, tabled=True)
    other = functions.taped(function, table)
    if other is not None and other.forward.operations > MAX_TABLE_OPERATIONS:
        return graph, taped
    return (table, other) if _operations(table, other) < most else (graph, taped)


def _products(forward: Graph, slopes: Bools, inputs: Mask, outputs: Mask) -> float:
    """Return operations of products with a table of that many slopes, which takes long to make.

    0 where it is soon made.
    """
    by = np.repeat(inputs, forward.sizes)
    of = np.repeat(outputs, forward.result_sizes)
    counts = slopes[of][:, by].sum(axis=0)
    return float(COUNT_CORRECTION * (counts + np.maximum(counts - 1, 0)).sum()) if counts.sum() > ALWAYS_TRIED else 0.0


Guards = tuple[int, int]
"""The words of a section and of a guard; -1: none."""


class PointPlaces:
    """Places of the values of one point that adjoints read, in the order in which they read them."""

    def __init__(self) -> None:
        """Start with no place read."""
        self._found: dict[Key, tuple[int, Guards]] = {}
        self.size = 0

    def of(self, place: Place, guards: Guards) -> int:
        """Return the first word of a place, which is read by an adjoint with these guards."""
        key = place.offset, place.size
        at, before = self._found.get(key, (self.size, guards))
        if key not in self._found:
            self.size += place.size
        self._found[key] = at, before if before == guards else (NONE, NONE)
        return at

    def read(self) -> list[tuple[int, int, int, int]]:
        """Return (first, count, section, guard) of what is read, except where section or guard is 0."""
        return [(*key, *guards) for key, (_, guards) in self._found.items()]


@dataclass
class Cell:
    """Two places for results of which each stands for the one before, such as a body's velocity after each contact.

    Only the call that writes one reads the one before. So their adjoints are needed one after the other: each call
    reads one of the two places and adds to the other. A call that is left out leaves its adjoint where it is.

    Attributes:
        members: in the order in which their adjoints are needed; they lie in the two places in turns.
        first, second: words where these begin.
    """

    members: list[Key]
    first: int = 0
    second: int = 0


class AdjointPlaces:
    """Places of adjoints: those of disjoint lifetimes share words, so that all stay in fast memory.

    A result that calls read as a whole lives from the adjoint of its last reader to that of its writer, which leaves it
    zeroed. All other words have places of their own.

    Attributes:
        size: words.
        cells: pairs of places.
    """

    def __init__(self, program: Program, target: Place, backward: Sequence[Pull]) -> None:
        """Allocate the words; ``backward``: adjoints in the order in which they are computed."""
        read, written = dict[Key, list[int]](), dict[Key, int]()
        parts: Ints = np.zeros(program.size, np.int64)
        for i, pull in enumerate(backward):
            for place in pull.marked("inputs"):
                read.setdefault((place.offset, place.size), []).append(i)
            for place in pull.marked("outputs"):
                written[place.offset, place.size] = i
        for offset, size in {*read, *written}:
            parts[offset : offset + size] += 1
        fixed = np.zeros(program.size, bool)
        for place in (target, program.z):
            fixed[place.offset : place.offset + place.size] = True
        whole = {
            key: (read[key][0], written[key])
            for key in read
            if key in written and (parts[key[0] : sum(key)] == 1).all() and not fixed[key[0] : sum(key)].any()
        }
        rest = fixed | (parts > 0)
        for offset, size in whole:
            rest[offset : offset + size] = False
        self.size = int(rest.sum())
        self._word: Ints = np.full(program.size, NONE, np.int64)
        self._word[rest] = np.arange(self.size)
        self.cells, self._of_key = list[Cell](), dict[Key, tuple[int, int]]()
        for i, pull in enumerate(backward):
            self._link(i, pull, whole, read)
        self._share(whole)

    def _link(self, i: int, pull: Pull, whole: dict[Key, Key], read: dict[Key, list[int]]) -> None:
        """Put results of a call, and what stands for them in any case, into cells."""
        copies = [set(other.copies) for other in pull.alternatives if other is not None]
        for copy in sorted(set.intersection(*copies)) if copies else ():
            after, before = (copy.offset, copy.size), (copy.source, copy.size)
            if after not in whole or before not in whole or set(read[before]) != {i}:
                continue
            if after not in self._of_key:
                self._of_key[after] = len(self.cells), 0
                self.cells.append(Cell([after]))
            number, parity = self._of_key[after]
            self._of_key[before] = number, 1 - parity
            self.cells[number].members.append(before)

    def _share(self, whole: dict[Key, Key]) -> None:
        """Allocate places of limited life: from the first reader to the writer."""
        alone = [(whole[key], key[1], key, NONE) for key in whole if key not in self._of_key]
        for number, cell in enumerate(self.cells):
            lives = [whole[key] for key in cell.members]
            both = min(first for first, _ in lives), max(last for _, last in lives)
            alone.append((both, cell.members[0][1], cell.members[0], number))
        free: dict[int, list[tuple[int, int]]] = {}
        for (first, last), size, key, number in sorted(alone):
            places = [self._taken(free.setdefault(size, []), first, last, size) for _ in range(1 + (number != NONE))]
            if number == NONE:
                self._put(key, places[0])
                continue
            cell = self.cells[number]
            cell.first, cell.second = places
            for member in cell.members:
                self._put(member, places[self._of_key[member][1]])

    def _taken(self, same: list[tuple[int, int]], first: int, last: int, size: int) -> int:
        index = next((i for i, (_, until) in enumerate(same) if until < first), None)
        at = same.pop(index)[0] if index is not None else self.size
        self.size += size if index is None else 0
        same.append((at, last))
        return at

    def _put(self, key: Key, at: int) -> None:
        self._word[key[0] : sum(key)] = at + np.arange(key[1])

    def of(self, offset: int, size: int) -> int:
        """Return the first word of a place."""
        return int(self._word[offset]) if size else 0

    def cell(self, offset: int, size: int) -> tuple[int, int]:
        """Return the number of the cell of a place and in which of its two places it lies; -1: it has none."""
        return self._of_key.get((offset, size), (NONE, 0))

    def ranges(self, place: Place) -> list[tuple[int, int]]:
        """Return (first, count) of the places where the adjoint of a place may lie."""
        number, _ = self.cell(place.offset, place.size)
        if number == NONE:
            return [(self.of(place.offset, place.size), place.size)]
        cell = self.cells[number]
        return [(cell.first, place.size), (cell.second, place.size)]


def merged(program: Program) -> list[FunctionCall]:
    """Return the calls of a program of one step, in order."""
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
    """Return one call that does all of these; ``reads``: by how many calls and outputs each word is read."""
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
    """Functions, entries and blocks of a Jacobian, for the compiler and the driver.

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
    # calls and their adjoints
    functions, target = DistinctFunctions(), program.outputs[output]
    calls = merged(program)
    first = _after_guards(calls)
    reaches = [CallActivity.of(call, 1, functions.dependence(call.function)) for call in calls]
    pulls = Pulls(Activity(program, [reaches, [], []], [target]), functions, program.size)
    found = [pulls.of(reach, k >= first) for k, reach in enumerate(reaches)]
    # forward pass with a tape; calls after the guards may be skipped
    forward = [
        (_push(reach.call, pull, functions), of_call(reach.call) if k >= first else ALWAYS)
        for k, (reach, pull) in enumerate(zip(reaches, found, strict=True))
    ]
    # adjoints, and the blocks of rows that share them
    backward = [pull for pull in reversed(found) if pull]
    places, values = AdjointPlaces(program, target, backward), PointPlaces()
    blocks = []
    adjoints, left = _adjoints(backward, places, values, functions), LeftWords(program, backward)
    for rows, taken in row_blocks(program, target, backward, lanes, functions):
        ranges = sorted({each for place in left.of(taken) for each in places.ranges(place)})
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
    """Return calls up to the last that computes a guard: they are not left out."""
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


class LeftWords:
    """Words that some adjoints write, and none of them reads and zeroes."""

    def __init__(self, program: Program, pulls: Sequence[Pull]) -> None:
        """Collect what each of the adjoints reads and writes."""
        self._program, keys = program, dict[tuple[int, int], int]()
        read = [(k, place.offset, place.size) for k, pull in enumerate(pulls) for place in pull.marked("outputs")]
        written = [(k, keys.setdefault(key, len(keys))) for k, pull in enumerate(pulls) for key in pull.written]
        self._read, self._written, self._keys = table(read, 3).T, table(written, 2).T, table([*keys], 2)

    def of(self, taken: Bools) -> list[Place]:
        """Return the places of which some words are left by those that are ``taken`` (k,); without that of z."""
        size, z = self._program.size, self._program.z
        which, start, count = self._read
        here, change = taken[which], np.zeros(size + 1, np.int64)
        np.add.at(change, start[here], 1)
        np.add.at(change, (start + count)[here], -1)
        unread = np.cumsum(change)[:size] == 0
        unread[z.offset : z.offset + z.size] = False
        before = np.concatenate([[0], np.cumsum(unread)])
        which, key = self._written
        starts, counts = self._keys[np.unique(key[taken[which]])].T
        some = before[starts + counts] > before[starts]
        return [Place(*each) for each in zip(starts[some].tolist(), counts[some].tolist(), strict=True)]


def _push(call: FunctionCall, pull: Pull | None, functions: DistinctFunctions) -> list[int]:
    form, places = Form(primal=len(call.inputs), adds=False), [*call.inputs, *call.outputs]
    if pull is None or pull.taped is None:
        return functions.entry(functions.forward(call.function), form, places)
    return functions.entry(pull.taped.forward, form, [*places, pull.tape])


def _entry(pull: Pull, places: AdjointPlaces, values: PointPlaces, functions: DistinctFunctions) -> list[int]:
    call, taped = pull.reach.call, pull.taped
    used = (taped.adjoint if taped else pull.graph).reads
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
    """Group rows into blocks, each row beside those with which it shares most adjoints; return those of each block."""
    taken = _taken(program, target, backward, functions)
    work = np.array([pull.work for pull in backward], float)
    left, blocks, shares = np.ones(target.size, bool), [], taken.astype(float)
    while left.any():
        rows, union = list[int](), np.zeros(len(backward), bool)
        while left.any() and len(rows) < lanes:
            gain = shares @ (np.where(union, work, -work) if rows else work)
            rows.append(int(np.argmax(np.where(left, gain, -np.inf))))
            left[rows[-1]] = False
            union |= taken[rows[-1]]
        blocks.append((rows, union))
    return blocks


def _taken(program: Program, target: Place, backward: Sequence[Pull], functions: DistinctFunctions) -> Bools:
    """Return the matrix (rows, adjoints): which adjoints a seed on each word of the output reaches."""
    useful = np.zeros((program.size, target.size), np.float32)
    useful[target.offset : target.offset + target.size] = np.eye(target.size)
    found, known = np.zeros((len(backward), target.size), bool), dict[int, NDArray[np.float32]]()
    for i, pull in enumerate(backward):
        reach = pull.reach
        outputs = np.concatenate([place.words(1)[0] for place in reach.call.outputs])
        inputs = np.concatenate([place.words(1)[0] for place in reach.call.inputs])
        graph = functions.forward(reach.call.function)
        if id(graph) not in known:
            known[id(graph)] = graph.sparsity().astype(np.float32).T
        on = np.concatenate(
            [np.full(place.size, mark) for place, mark in zip(reach.call.outputs, pull.outputs, strict=True)]
        )
        seeded = useful[outputs] * on[:, None]
        found[i] = seeded.any(axis=0)
        useful[inputs] = np.maximum(useful[inputs], np.minimum(known[id(graph)] @ seeded, 1))
    return np.ascontiguousarray(found.T)
