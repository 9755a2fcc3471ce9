"""Plans a program: the functions to compile, and the tables that the driver walks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.form import Form
from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.emit.guarding import TABLES, guarding_of
from symphys.codegen.emit.packs import pack_calls
from symphys.codegen.emit.planned import Plan
from symphys.codegen.emit.tables import Recipe, Table, table_of
from symphys.codegen.graph.activity import AnnotatedCalls, LivenessGraph
from symphys.codegen.graph.graph import Graph, Mask, Taped
from symphys.codegen.program.phase_calls import PhaseCalls, grouped, rows_of
from symphys.codegen.program.program import Function, Place, Program
from symphys.codegen.program.spans import Spans
from symphys.types import Ints

NONE = -1
TAPE = ("tape", 0)
FAST_MEMORY = 12 * 2**20
"""[bytes] of a block beyond which reading a tape costs more than computing its values again: 16 spheres in a heap, 32
MiB with a tape, took 8.5 times the rollout for a gradient, and 4.6 without; 8 spheres, 8 MiB, took 3.6 with one."""


def plan(program: Program, seeded: Sequence[str], word: int = 64, noted: bool = True) -> Plan:
    """Plan the forward pass and the gradient with respect to z of the seeded outputs.

    Args:
        program: what to compute.
        seeded: names of the outputs that are differentiated.
        word: bytes of one word of a whole block: lanes times the size of a number.
        noted: whether the driver notes which guards are 0 in a step, otherwise they are computed again backwards, and
            takes ``again`` for the body where it has all calls of the only step.
    """
    # packs, then activity and adjoints of all phases
    side_by_side = pack_calls(program)
    program, functions = side_by_side.program, DistinctFunctions()
    parts, reach = with_adjoints(program, seeded, functions)
    body = parts[1]
    # calls that are run again before the adjoints of a step, and what a tape spares them
    at_once = noted and _taped_at_once(program)
    again = np.ones(len(body.calls), bool) if at_once else _again(program, body, reach, noted)
    tape = _put_on_tape(program, body, again, functions, FAST_MEMORY // word)
    # tables of calls forward, again and backward, and of calls that may be skipped
    tables = {name: part.pushes(functions) for name, part in zip(("prologue", "body", "epilogue"), parts, strict=True)}
    tables["again"] = body.pushes(functions, np.flatnonzero(again))
    for name, part in zip(("prologue", "body", "epilogue"), parts, strict=True):
        tables[f"back_{name}"] = part.pulls(functions)
    guarding = guarding_of(program, {name: tables[name] for name in TABLES})
    filled = {name: (len(table.calls), table.filled()) for name, table in tables.items()}
    callers = {name: tables[name].calls for name in TABLES}
    return Plan(
        tuple(functions.listed), filled, tape, _written(program), guarding, program, side_by_side.packs, callers
    )


def with_adjoints(
    program: Program, seeded: Sequence[str], functions: DistinctFunctions, varying: Sequence[Place] = ()
) -> tuple[list[PlannedPhase], LivenessGraph]:
    """Return the phases of a program, with the adjoints of what matters to the seeded outputs and depends on z.

    What is in ``varying`` counts as dependent too.
    """
    parts = [PlannedPhase(calls, steps) for calls, steps in zip(program.phases, (1, program.steps, 1), strict=True)]
    reach = LivenessGraph(
        program.size, [AnnotatedCalls(part.calls, part.steps, part.dependence(functions)) for part in parts]
    )
    outputs = [_words_of(program.outputs[name]) for name in seeded]
    inputs = np.concatenate([_words_of(place) for place in (program.z, *varying)])
    active = reach.forwards(inputs) & reach.backwards(np.concatenate([np.zeros(0, np.int64), *outputs]))
    for part in parts:
        part.find_adjoints(active, functions)
    return parts, reach


def _written(program: Program) -> Ints:
    places = program.phases[1].outputs
    own = places.stride != 0
    return np.stack([places.offset[own], places.size[own], places.stride[own]], axis=1)


class _Kind(NamedTuple):
    """Calls of one function whose adjoints are with respect to the same arguments and results."""

    function: Function
    inputs: Mask
    outputs: Mask
    graph: Graph


class PlannedPhase:
    """A phase, and once they are known its adjoints and their tapes.

    Attributes:
        calls: of the phase.
        steps: in which they are made.
        kinds: of adjoints.
        kind: (calls,) which adjoint each call has; -1: none.
        tape: (calls,) where its tape begins; -1: it has none.
        taped: for each kind its functions with a tape.
    """

    def __init__(self, calls: PhaseCalls, steps: int) -> None:
        """Start without adjoints."""
        self.calls, self.steps = calls, steps
        self.kinds: list[_Kind] = []
        self.kind = np.full(len(calls), NONE, np.int64)
        self.tape = np.full(len(calls), NONE, np.int64)
        self.taped: dict[int, Taped] = {}

    def dependence(self, functions: DistinctFunctions) -> list[NDArray[np.bool_]]:
        """Map each function to the dependencies of the words of its results on its arguments."""
        none = (np.zeros((0, function.n_in()), bool) for function in self.calls.functions)
        each = map(functions.dependence, self.calls.functions)
        return [np.concatenate([nothing, *found]) for nothing, found in zip(none, each, strict=True)]

    def find_adjoints(self, active: NDArray[np.bool_], functions: DistinctFunctions) -> None:
        """Collect the calls with active arguments and results, given the active words of the memory."""
        before = np.concatenate([[0], np.cumsum(active)])
        marks = [_any(before, spans, self.steps) for spans in (self.calls.inputs, self.calls.outputs)]
        found: list[tuple[int, Ints, Function, Mask, Mask]] = []
        for number, calls in self.calls.by_function():
            reads, gives = marks[0][rows_of(self.calls.inputs, calls)], marks[1][rows_of(self.calls.outputs, calls)]
            for mine in _alike(np.concatenate([reads, gives], axis=1)):
                masks: tuple[Mask, Mask] = tuple(reads[mine[0]].tolist()), tuple(gives[mine[0]].tolist())
                if any(masks[0]) and any(masks[1]):
                    found.append((int(calls[mine[-1]]), calls[mine], self.calls.functions[number], *masks))
        for _, calls, function, inputs, outputs in sorted(found, key=lambda each: -each[0]):
            self.kind[calls] = len(self.kinds)
            self.kinds.append(_Kind(function, inputs, outputs, functions.adjoint(function, inputs, outputs)))

    def pushes(self, functions: DistinctFunctions, calls: Ints | None = None) -> Table:
        """Return the table of calls; None: of all, without tapes."""
        count, again = len(self.calls.functions), calls is not None
        chosen = np.arange(len(self.calls)) if calls is None else calls
        plain = 2 * self.calls.number[chosen] + self.calls.accumulate[chosen]
        taped = (self.tape[chosen] != NONE) & again

        def recipe(kind: int) -> Recipe:
            number, adds = divmod(kind, 2)
            pair = self.taped[number - count] if number >= count else None
            function = self.kinds[number - count].function if pair else self.calls.functions[number]
            columns = [*_columns("in", [True] * function.n_in()), *_columns("out", [True] * function.n_out())]
            form = Form(primal=function.n_in(), adds=bool(adds))
            graph = pair.forward if pair else functions.forward(function)
            return Recipe(functions.number(graph, form), (*columns, *([TAPE] if pair else [])))

        kinds = np.where(taped, 2 * (count + self.kind[chosen]), plain)
        return table_of(self.calls, chosen, kinds, recipe, self.tape)

    def pulls(self, functions: DistinctFunctions) -> Table:
        """Return the table of adjoints."""
        chosen = np.flatnonzero(self.kind != NONE)[::-1]

        def recipe(number: int) -> Recipe:
            kind, adds, taped = self.kinds[number // 4], number // 2 % 2, number % 2
            primal = [*_columns("in", [True] * kind.function.n_in()), *([TAPE] if taped else [])]
            form = Form(primal=len(primal), adds=True, backward=True, clears=not adds)
            marked = [*_columns("out", kind.outputs), *_columns("in", kind.inputs)]
            graph = self.taped[number // 4].adjoint if taped else kind.graph
            return Recipe(functions.number(graph, form), (*primal, *marked))

        kinds = 4 * self.kind[chosen] + 2 * self.calls.accumulate[chosen] + (self.tape[chosen] != NONE)
        return table_of(self.calls, chosen, kinds, recipe, self.tape)


def _columns(side: str, mask: Sequence[bool]) -> list[tuple[str, int]]:
    return [(side, i) for i, on in enumerate(mask) if on]


def _alike(marks: NDArray[np.bool_]) -> list[Ints]:
    """Return rows that are equal, in order."""
    bits = np.ascontiguousarray(np.packbits(marks, axis=1))
    if not bits.size:
        return [np.arange(len(marks))]
    _, whose = np.unique(bits.view(np.dtype((np.void, bits.shape[1]))).ravel(), return_inverse=True)
    return grouped(whose.ravel(), int(whose.max()) + 1)


def _any(before: Ints, spans: Spans, steps: int) -> NDArray[np.bool_]:
    """Return for each place (places,) whether a word is active at any step; ``before``: active words before each."""
    found: NDArray[np.bool_] = before[spans.offset + spans.size] > before[spans.offset]
    if steps == 1:
        return found
    moving = np.flatnonzero(spans.stride)
    each, whose = np.unique(np.stack([spans.offset, spans.size, spans.stride])[:, moving], axis=1, return_inverse=True)
    on = np.zeros(each.shape[1], bool)
    for k in range(steps):
        first = each[0] + k * each[2]
        on |= before[first + each[1]] > before[first]
    found[moving] = on[whose.ravel()]
    return found


def _taped_at_once(program: Program) -> bool:
    """Whether a gradient computes no values twice: there is one step, and no call of it may be left out."""
    return program.steps == 1 and not any(call.guard is not None or call.section is not None for call in program.body)


def _again(program: Program, body: PlannedPhase, reach: LivenessGraph, noted: bool) -> NDArray[np.bool_]:
    """Return flags (calls,) of those to run again before the adjoints of a step: those whose scratch is read."""
    spans = body.calls.inputs
    used = [[i for i in range(kind.function.n_in()) if i in kind.graph.reads] for kind in body.kinds]
    read = [np.zeros(0, np.int64)]
    for kind, calls in enumerate(grouped(body.kind + 1, len(body.kinds) + 1)[1:]):
        read.append((spans.starts[calls][:, None] + np.array(used[kind], np.int64)).ravel())
    words = {call.section.offset for call in program.body if call.section is not None}
    if not noted:
        words |= {call.guard.offset for call in program.body if call.guard is not None}
    return reach.producers(np.concatenate(read), np.array(sorted(words), np.int64), program.scratch(), phase=1)


def _put_on_tape(
    program: Program, body: PlannedPhase, again: NDArray[np.bool_], functions: DistinctFunctions, room: int
) -> int:
    """Give the calls that are run again a tape if all then still fits into ``room`` words; returns its words."""
    if 2 * program.size > room:
        return 0
    pulled = np.flatnonzero(again & (body.kind != NONE) & ~body.calls.accumulate)[::-1]
    sizes = np.zeros(len(body.kinds), np.int64)
    for number in np.unique(body.kind[pulled]).tolist():
        kind = body.kinds[number]
        if pair := functions.taped(kind.function, kind.graph):
            body.taped[number], sizes[number] = pair, pair.size
    own = sizes[body.kind[pulled]]
    if 2 * program.size + int(own.sum()) > room:
        return 0
    on = own > 0
    body.tape[pulled[on]] = (program.size + np.cumsum(own) - own)[on]
    return int(own.sum())


def _words_of(place: Place) -> Ints:
    found: Ints = place.still().words(1)[0]
    return found
