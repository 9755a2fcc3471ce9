"""Forward mode: a program that carries, beside each number, its derivatives in a few directions.

Where few numbers set many, as parameters set a whole recorded motion, this takes one pass for a group of directions,
and an adjoint one for each number that is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.graph.activity import Activity, CallActivity
from symphys.codegen.program.program import Function, FunctionCall, Place, Program

TANGENT = "tangent"
"""``z.tangent``: of the output ``z`` of a tangent program."""
COPY_SIZE = 64
"""Words that one call copies."""
Mask = tuple[bool, ...]


def tangent_name(output: str) -> str:
    """Return the output with the derivatives of another (size * directions,), all directions of a number together."""
    return f"{output}.{TANGENT}"


def tangent_program(program: Program, directions: int, outputs: Sequence[str]) -> Program:
    """Return a program with the same outputs, and with derivatives of some of them along given directions.

    Its parameters are those of the program, and after them the directions (size of z * directions,): how z changes
    along each of them, all directions of a number together.

    Args:
        program: what is differentiated.
        directions: how many at once.
        outputs: names of those whose derivatives are wanted; see ``tangent_name``.
    """
    return _TangentWriter(program, directions, outputs).written()


class _TangentWriter:
    """Writes the calls; word w of the program has its derivatives at ``size + directions w`` and after."""

    def __init__(self, program: Program, directions: int, outputs: Sequence[str]) -> None:
        self.program, self.directions, self.wanted = program, directions, outputs
        functions = DistinctFunctions()
        phases = [
            [CallActivity.of(call, steps, functions.dependence(call.function)) for call in calls]
            for calls, steps in ((program.prologue, 1), (program.body, program.steps), (program.epilogue, 1))
        ]
        self.activity = Activity(program, phases, [program.outputs[name] for name in outputs])
        self.phases = phases
        self._made: dict[tuple[object, ...], Function] = {}
        self.carried = np.zeros(program.size, bool)
        """Words whose derivatives are written."""
        self.read = np.zeros(program.size, bool)

    def written(self) -> Program:
        program, n = self.program, self.program.z.size
        parameters = Place((1 + self.directions) * program.size, program.parameters.size + self.directions * n)
        given = Place(parameters.offset, program.parameters.size)
        seeds = Place(given.offset + given.size, self.directions * n)
        self.carried[program.z.still().words(1)] = True
        begin = [*_copied(seeds, self.tangent(program.z)), *_copied(given, program.parameters)]
        calls = [[self._call(each) for each in phase] for phase in self.phases]
        for name in self.wanted:
            self.read[program.outputs[name].still().words(1)] = True
        return Program(
            size=parameters.offset + parameters.size,
            z=program.z,
            parameters=parameters,
            steps=program.steps,
            outputs={
                **program.outputs,
                **{tangent_name(name): self.tangent(program.outputs[name]) for name in self.wanted},
            },
            prologue=(*begin, *calls[0]),
            body=tuple(calls[1]),
            epilogue=tuple(calls[2]),
            zeroed=(*program.zeroed, *self._zeroed()),
            constants=program.constants,
            discounted=program.discounted,
        )

    def tangent(self, place: Place) -> Place:
        """Return the place of the derivatives of a place."""
        d = self.directions
        return Place(self.program.size + d * place.offset, d * place.size, d * place.stride)

    def _call(self, reach: CallActivity) -> FunctionCall:
        """Return the call with the derivatives of what is active."""
        call = reach.call
        inputs, outputs = self.activity.marks(reach.inputs), self.activity.marks(reach.outputs)
        if not any(outputs) or (call.accumulate and not any(inputs)):
            return call
        for on, words in zip(inputs, reach.inputs, strict=True):
            self.read[words] |= on
        written = self.read if call.accumulate else self.carried
        for on, words in zip(outputs, reach.outputs, strict=True):
            written[words] |= on
        key = (call.function.__hash__(), inputs, outputs)
        if key not in self._made:
            self._made[key] = with_derivatives(call.function, inputs, outputs, self.directions)
        seeds = [self.tangent(place) for place, on in zip(call.inputs, inputs, strict=True) if on]
        found = [self.tangent(place) for place, on in zip(call.outputs, outputs, strict=True) if on]
        return FunctionCall(self._made[key], (*call.inputs, *seeds), (*call.outputs, *found), call.accumulate)

    def _zeroed(self) -> list[Place]:
        """Return derivatives that are read or added to, and that no call writes."""
        return [self.tangent(Place(first, count)) for first, count in _runs(self.read & ~self.carried)]


def with_derivatives(function: Function, inputs: Mask, outputs: Mask, directions: int) -> Function:
    """Map arguments and derivatives of the marked ones to results and derivatives of the marked ones."""
    arguments = [ca.SX.sym("x", function.numel_in(i)) for i in range(function.n_in())]
    results = [ca.densify(each) for each in function.call(arguments, True, False)]
    by = [x for x, on in zip(arguments, inputs, strict=True) if on]
    seeds = [ca.SX.sym("d", directions, x.numel()) for x in by]
    marked = [r for r, on in zip(results, outputs, strict=True) if on]
    values = ca.vertcat(*marked)
    along = ca.SX(values.numel(), directions)
    if by:
        along = ca.jtimes(values, ca.vertcat(*by), ca.horzcat(*seeds).T, False)
    ends = np.cumsum([0, *(r.numel() for r in marked)]).tolist()
    found = [ca.densify(ca.vec(piece.T)) for piece in ca.vertsplit(ca.densify(along), ends)]
    whole = ca.cse([*results, *found])
    return ca.Function(f"{function.name()}_{TANGENT}", [*arguments, *map(ca.vec, seeds)], whole)


def _copied(source: Place, target: Place) -> list[FunctionCall]:
    """Return calls that copy, most of them of the same function: one for all words would be as long as they are."""
    calls = []
    for first in range(0, source.size, COPY_SIZE):
        x = ca.SX.sym("x", min(COPY_SIZE, source.size - first))
        places = [Place(place.offset + first, x.numel()) for place in (source, target)]
        calls.append(FunctionCall(ca.Function("copied", [x], [x]), (places[0],), (places[1],)))
    return calls


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first word and length of each run of words that are marked."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(a), int(b - a)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
