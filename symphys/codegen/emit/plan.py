"""From a program to what is compiled, and to the tables that the driver walks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.emit.guarding import TABLES, Guarding, guarding_of
from symphys.codegen.emit.writer import Form
from symphys.codegen.graph.activity import Activity, CallActivity, Words
from symphys.codegen.graph.adjoint import Mask
from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.rewrite import Taped
from symphys.codegen.program.program import FunctionCall, Place, Program

Table = NDArray[np.int64]
Entries = list[list[int]]
FAST_MEMORY = 12 * 2**20
"""[bytes] of a block beyond which reading a tape costs more than computing its values again: 16 spheres in a heap, 32
MiB with a tape, took 8.5 times the rollout for a gradient, and 4.6 without; 8 spheres, 8 MiB, took 3.6 with one."""


@dataclass(frozen=True)
class Plan:
    """What the compiler and the driver need.

    Attributes:
        functions: the C functions, in the order of their numbers.
        tables: for each phase the number of calls and their entries.
        tape: words after the program's own, for what adjoints need not compute again.
        written: (places, 3) offset, size and stride of what each step of the body writes for itself.
        guarding: of calls that may be left out; None: none may.
    """

    functions: tuple[tuple[Graph, Form], ...]
    tables: dict[str, tuple[int, Table]]
    tape: int
    written: Table
    guarding: Guarding | None = None

    def moving(self) -> list[set[int]]:
        """For each function, which of its places move with the step in any of its calls."""
        found: list[set[int]] = [set() for _ in self.functions]
        order = [*TABLES, *(name for name in self.tables if name not in TABLES)]
        words = np.concatenate([self.tables[name][1] for name in order])
        moves = words != 0
        if self.guarding is not None:
            self.guarding.mark_redirected(moves)
        starts: dict[int, list[int]] = {}
        begin = 0
        for count, table in (self.tables[name] for name in order):
            entries, at = table.tolist(), 0
            for _ in range(count):
                starts.setdefault(entries[at], []).append(begin + at)
                at += entries[at + 1]
            begin += len(table)
        for number, calls in starts.items():
            places = np.arange((words[calls[0] + 1] - 2) // 2)
            strides = moves[np.array(calls)[:, None] + 3 + 2 * places]
            found[number] = set(np.flatnonzero(strides.any(axis=0)).tolist())
        return found


def plan(program: Program, seeded: Sequence[str], word: int = 64) -> Plan:
    """Plan the forward pass and the gradient with respect to z of the seeded outputs.

    Args:
        program: what to compute.
        seeded: names of the outputs that are differentiated.
        word: bytes of one word of a whole block: lanes times the size of a number.
    """
    functions = DistinctFunctions()
    prologue, body, epilogue = phases = (
        _reaches(program.prologue, 1, functions),
        _reaches(program.body, program.steps, functions),
        _reaches(program.epilogue, 1, functions),
    )
    activity = Activity(program, phases, [program.outputs[name] for name in seeded])
    pulls = [[pull for reach in reversed(phase) if (pull := _pull(reach, activity, functions))] for phase in phases]
    again = _again(program, body, pulls[1], functions)
    tape = _put_on_tape(program, pulls[1], again, functions, FAST_MEMORY // word)
    entries: dict[str, Entries] = {
        "prologue": [_push(reach.call, functions) for reach in prologue],
        "body": [_push(reach.call, functions) for reach in body],
        "epilogue": [_push(reach.call, functions) for reach in epilogue],
        "again": [_push(reach.call, functions, reach.tape) for reach in again],
        "back_prologue": [pull.entry(functions) for pull in pulls[0]],
        "back_body": [pull.entry(functions) for pull in pulls[1]],
        "back_epilogue": [pull.entry(functions) for pull in pulls[2]],
    }
    guarded = {
        "body": ([reach.call for reach in body], entries["body"]),
        "again": ([reach.call for reach in again], entries["again"]),
        "back_body": ([pull.reach.call for pull in pulls[1]], entries["back_body"]),
    }
    tables = {name: (len(rows), _flat(rows)) for name, rows in entries.items()}
    return Plan(tuple(functions.listed), tables, tape, _written(program), guarding_of(program, guarded))


def _written(program: Program) -> Table:
    places = [place for call in program.body for place in call.outputs if place.stride]
    return np.array([(place.offset, place.size, place.stride) for place in places], np.int64).reshape(-1, 3)


@dataclass
class _Tape:
    """A place for values that a call's adjoint needs, and the functions that write and read it."""

    functions: Taped
    place: Place


@dataclass
class _Reach(CallActivity):
    """A call and, once that is known, its tape."""

    tape: _Tape | None = None


@dataclass(frozen=True)
class _Pull:
    """The adjoint of a call, with respect to the marked arguments and results."""

    reach: _Reach
    graph: Graph
    inputs: Mask
    outputs: Mask

    def reads(self, functions: DistinctFunctions) -> list[Words]:
        """The words of the memory that it reads."""
        used = functions.arguments(self.graph)
        return [words for i, words in enumerate(self.reach.inputs) if i in used]

    def entry(self, functions: DistinctFunctions) -> list[int]:
        """Its table entry."""
        call, tape = self.reach.call, self.reach.tape
        primal = [*call.inputs, *([tape.place] if tape else [])]
        form = Form(primal=len(primal), adds=True, backward=True, clears=not call.accumulate)
        places = [*primal, *_marked(call.outputs, self.outputs), *_marked(call.inputs, self.inputs)]
        return functions.entry(tape.functions.adjoint if tape else self.graph, form, places)


def _reaches(calls: Sequence[FunctionCall], steps: int, functions: DistinctFunctions) -> list[_Reach]:
    return [_Reach.of(call, steps, functions.dependence(call.function)) for call in calls]


def _push(call: FunctionCall, functions: DistinctFunctions, tape: _Tape | None = None) -> list[int]:
    form = Form(primal=len(call.inputs), adds=call.accumulate)
    graph = tape.functions.forward if tape else functions.forward(call.function)
    return functions.entry(graph, form, [*call.inputs, *call.outputs, *([tape.place] if tape else [])])


def _pull(reach: _Reach, activity: Activity, functions: DistinctFunctions) -> _Pull | None:
    inputs, outputs = activity.marks(reach.inputs), activity.marks(reach.outputs)
    if not any(inputs) or not any(outputs):
        return None
    return _Pull(reach, functions.adjoint(reach.call.function, inputs, outputs), inputs, outputs)


def _again(
    program: Program, body: Sequence[_Reach], pulls: Sequence[_Pull], functions: DistinctFunctions
) -> list[_Reach]:
    """The calls that must be run again before the adjoints of a step: those whose scratch is read."""
    scratch = program.scratch()
    needed = np.zeros(program.size, dtype=bool)
    for pull in pulls:
        for words in pull.reads(functions):
            needed[words] = True
    for call in program.body:
        if call.section is not None:
            needed[call.section.offset] = True
    needed &= scratch
    chosen = []
    for reach in reversed(body):
        if any(needed[words].any() for words in reach.outputs):
            chosen.append(reach)
            for words in reach.inputs:
                needed[words] |= scratch[words]
    return chosen[::-1]


def _put_on_tape(
    program: Program, pulls: Sequence[_Pull], again: Sequence[_Reach], functions: DistinctFunctions, room: int
) -> int:
    """Give the calls that are run again a tape if all then still fits into ``room`` words; returns its words."""
    end = program.size
    repeated = {id(reach) for reach in again if not reach.call.accumulate}
    for pull in pulls:
        if id(pull.reach) not in repeated:
            continue
        if pair := functions.taped(functions.forward(pull.reach.call.function), pull.graph):
            pull.reach.tape = _Tape(pair, Place(end, pair.size))
            end += pair.size
    if program.size + end <= room:
        return end - program.size
    for pull in pulls:
        pull.reach.tape = None
    return 0


def _marked(places: Sequence[Place], marks: Mask) -> list[Place]:
    return [place for place, on in zip(places, marks, strict=True) if on]


def _flat(rows: Entries) -> Table:
    return np.array([x for row in rows for x in row] or [0], dtype=np.int64)
