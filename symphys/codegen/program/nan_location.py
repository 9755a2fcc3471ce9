"""Location of the first value of a rollout that is not finite."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.program.program import FunctionCall, Place, Program
from symphys.codegen.runtime.library import Loaded, Memory
from symphys.records import dataclass

if TYPE_CHECKING:
    from symphys.codegen.runtime.batch import RolloutBatch


@dataclass(frozen=True)
class Bad:
    """A value that is not finite.

    Attributes:
        phase: "inputs", "prologue", "body" or "epilogue".
        step: the time step; 0 outside the body.
        call: the number of the call in its phase; -1 for the inputs.
        function: the name of its function; "z" or "parameters" for the inputs.
        word: the word of the memory.
        value: nan, inf or -inf.
    """

    phase: str
    step: int
    call: int
    function: str
    word: int
    value: float

    def __str__(self) -> str:
        """Say it in a line."""
        where = f"step {self.step}, {self.function}" if self.phase == "body" else f"{self.phase}, {self.function}"
        return f"{where}: word {self.word} is {self.value}"


def first_bad(program: Program, loaded: Loaded, batch: RolloutBatch, memory: Memory) -> Bad | None:
    """Run one rollout phase by phase and step by step, and look at all that each wrote."""
    loaded.begin(batch.part(0, 1), memory)
    lane = memory[:, 0]
    for name, place in (("z", program.z), ("parameters", program.parameters)):
        if (word := _not_finite(lane, place)) is not None:
            return Bad("inputs", 0, -1, name, word, float(lane[word]))
    for phase, k, calls in _stretches(program):
        loaded.perform(phase, memory, k)
        words = np.concatenate([_words(place, k) for call in calls for place in call.outputs])
        if not np.isfinite(lane[words]).all():
            return _culprit(phase, k, calls, lane)
    return None


def _stretches(program: Program) -> Iterator[tuple[str, int, Sequence[FunctionCall]]]:
    if program.prologue:
        yield "prologue", 0, program.prologue
    for k in range(program.steps if program.body else 0):
        yield "body", k, program.body
    if program.epilogue:
        yield "epilogue", 0, program.epilogue


def _culprit(phase: str, k: int, calls: Sequence[FunctionCall], lane: NDArray[np.floating]) -> Bad | None:
    """Return the first call with such a result; calls that add are asked for what they add."""
    for i, call in enumerate(calls):
        for r, place in enumerate(call.outputs):
            word = _not_finite(lane, place, k)
            if word is not None and (not call.accumulate or not np.isfinite(_added(call, r, k, lane)).all()):
                return Bad(phase, k, i, call.function.name(), word, float(lane[word]))
    return None


def _added(call: FunctionCall, result: int, k: int, lane: NDArray[np.floating]) -> NDArray[np.float64]:
    values = call.function.call([lane[_words(place, k)].astype(float) for place in call.inputs])[result].full()
    return np.asarray(values)


def _words(place: Place, k: int) -> NDArray[np.int64]:
    return place.offset + k * place.stride + np.arange(place.size)


def _not_finite(lane: NDArray[np.floating], place: Place, k: int = 0) -> int | None:
    words = _words(place, k)
    bad = words[~np.isfinite(lane[words])]
    return int(bad[0]) if len(bad) else None
