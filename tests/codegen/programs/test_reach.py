"""What depends on what, found for all calls at once, is what going through them one by one finds."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from symphys.codegen import FunctionCall, MemoryLayout, Place, Program
from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.graph.activity import Activity, AnnotatedCalls, CallActivity, LivenessGraph

STEPS = 3


def mixing(random: np.random.Generator, sizes: list[int], results: list[int]) -> ca.Function:
    """Each word of a result depends on a few words of the arguments, or on none."""
    arguments = [ca.SX.sym("a", size) for size in sizes]
    words = ca.vertcat(*arguments)
    columns = []
    for size in results:
        chosen = [random.choice(words.numel(), random.integers(0, 4)) for _ in range(size)]
        chosen[0] = np.arange(words.numel())
        columns.append(ca.vertcat(*(sum((ca.sin(words[int(k)]) for k in own), ca.SX(1)) for own in chosen)))
    return ca.Function("mixing", arguments, columns)


def random_program(seed: int) -> Program:
    """A state of three steps, scratch, and a total that each step adds to."""
    random, at = np.random.default_rng(seed), MemoryLayout()
    z, x, total, out = at.take(3), at.series(2, STEPS + 1), at.take(2), at.take(2)
    known, body = [x, z], list[FunctionCall]()
    for _ in range(12):
        inputs = [known[int(k)] for k in random.choice(len(known), 2, replace=False)]
        results = [at.take(int(size)) for size in random.integers(1, 4, 2)]
        function = mixing(random, [place.size for place in inputs], [place.size for place in results])
        body.append(FunctionCall(function, tuple(inputs), tuple(results)))
        known += [*results, Place(results[0].offset, 1)]
    body.append(FunctionCall(mixing(random, [known[-2].size], [2]), (known[-2],), (x.later(),)))
    body.append(FunctionCall(mixing(random, [2], [2]), (x.later(),), (total,), accumulate=True))
    start = FunctionCall(mixing(random, [3], [2]), (z,), (x.still(),))
    end = FunctionCall(mixing(random, [2, 2], [2]), (total, x.later(STEPS).still()), (out,))
    return Program(at.size, z, Place(0, 0), STEPS, {"out": out}, (start,), tuple(body), (end,), (total,))


@pytest.mark.parametrize("seed", range(8))
def test_words_that_matter(seed: int) -> None:
    program, functions = random_program(seed), DistinctFunctions()
    steps = (1, program.steps, 1)
    one_by_one = Activity(
        program,
        [
            [CallActivity.of(call, count, functions.dependence(call.function)) for call in phase.calls]
            for phase, count in zip(program.phases, steps, strict=True)
        ],
        [program.outputs["out"]],
    )
    at_once = LivenessGraph(
        program.size,
        [
            AnnotatedCalls(
                phase, count, [np.concatenate(functions.dependence(function)) for function in phase.functions]
            )
            for phase, count in zip(program.phases, steps, strict=True)
        ],
    )
    moving = at_once.forwards(program.z.words(1)[0])
    active = moving & at_once.backwards(program.outputs["out"].words(1)[0])
    assert active.tolist() == one_by_one.active.tolist()
    assert 0 < active.sum() < program.size
