"""The reference: a program run call by call by casadi, in numpy. Slow, needs no compiler, and is what tests compare."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from symphys.codegen.program.program import FunctionCall, Place, Program
from symphys.types import Array


def interpret(program: Program, z: ArrayLike, parameters: ArrayLike = ()) -> dict[str, Array]:
    """Return the outputs of one rollout."""
    memory = remember(program, z, parameters)
    return {name: at(memory, place, 0).copy() for name, place in program.outputs.items()}


def remember(program: Program, z: ArrayLike, parameters: ArrayLike = ()) -> Array:
    """Return the memory (size,) after one rollout, with all trajectories."""
    memory = np.full(program.size, np.nan)
    for place in program.zeroed:
        at(memory, place, 0)[:] = 0
    for place, values in program.constants:
        at(memory, place, 0)[:] = values
    at(memory, program.z, 0)[:] = z
    at(memory, program.parameters, 0)[:] = parameters
    for call, k in _order(program):
        _perform(call, memory, k)
    return memory


def at(memory: Array, place: Place, k: int) -> Array:
    """Return a view of the words of a place at step k."""
    start = place.offset + k * place.stride
    return memory[start : start + place.size]


def _order(program: Program) -> Iterator[tuple[FunctionCall, int]]:
    yield from ((call, 0) for call in program.prologue)
    for k in range(program.steps):
        yield from ((call, k) for call in program.body)
    yield from ((call, 0) for call in program.epilogue)


def _perform(call: FunctionCall, memory: Array, k: int) -> None:
    results = call.function.call([at(memory, place, k) for place in call.inputs])
    for place, result in zip(call.outputs, results, strict=True):
        target = at(memory, place, k)
        target[:] = result.full().ravel() + (target if call.accumulate else 0)
