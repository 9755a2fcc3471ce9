"""Kernels that leave out calls without effect give what kernels give that do not, to the last bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.plain_c import plain
from tools.repeats import few, thorough
from worlds.guarded import guarded_sections, halving, program_of, whole

from symphys.codegen import (
    Cache,
    Place,
    ProcessorKernel,
    Program,
    ProgramError,
    compile_program,
)
from symphys.codegen.emit.guarding import guarding_of
from symphys.codegen.emit.plan import plan


@pytest.fixture(params=["spheres", *map(thorough, ("capsules", "a box", "soft"))])
def heap_program(request: pytest.FixtureRequest) -> Program:
    return program_of(request.param)


def spoil(kernel: ProcessorKernel) -> None:
    """No number is left in the memories: what a call that was left out would have written there is not read."""
    memories = [(width.loaded.words, memory) for width in kernel.widths.loaded.values() for memory in width.pool._free]
    assert memories
    for words, memory in memories:
        memory[:words] = np.nan


@pytest.mark.slow
def test_values_and_gradients_are_the_same_to_the_last_bit(heap_program: Program, cache: Cache) -> None:
    guess = np.random.default_rng(2).uniform(-2, 2, (11, heap_program.z.size))
    results = []
    for program in (heap_program, whole(heap_program)):
        kernel = compile_program(program, cache=cache, threads=1, seeded=("merit",), lanes=4)
        values, gradients = kernel.gradient(guess, [1.0], [0.0])
        spoil(kernel)
        again = kernel.forward(guess[::-1], [0.0])  # in another order: what the driver has noted is of no influence
        assert all(np.array_equal(again[name][::-1], values[name]) for name in values)
        results.append((values, gradients))
    (values, gradients), (others, expected) = results
    assert np.isfinite(gradients).all()
    assert np.abs(expected).max() > 0
    assert all(np.array_equal(values[name], others[name]) for name in values)
    assert np.array_equal(gradients, expected)


@pytest.mark.slow
def test_most_calls_of_a_heap_are_guarded(heap_program: Program, request: pytest.FixtureRequest) -> None:
    """Sections are what steps without an impact leave out; soft contacts have none."""
    guarding = plan(heap_program, ["merit"]).guarding
    assert guarding is not None
    guarded = sum(call.guard is not None for call in heap_program.body)
    assert guarded > 0.8 * len(heap_program.body)
    assert (guarding.count("sections") > 0) == ("soft" not in request.node.name)


@pytest.mark.thorough
def test_plain_c_leaves_out_the_same(tmp_path: Path, cache: Cache) -> None:
    program = program_of("spheres")
    program = replace(program, outputs={"merit": program.outputs["merit"]})
    kernel = compile_program(program, cache=cache, threads=1, seeded=("merit",))
    call, guess = plain(program, tmp_path), np.random.default_rng(1).uniform(-2, 2, program.z.size)
    outputs, gradient = call(guess, [0.0], [1.0])
    values, expected = kernel.gradient(guess, [1.0], [0.0])
    assert outputs.tolist() == values["merit"].ravel().tolist()
    assert gradient == pytest.approx(expected.ravel(), rel=1e-9, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("older", [False, True])
def test_a_guard_of_which_an_older_result_is_read_is_given_up(older: bool, cache: Cache) -> None:
    kernels = [compile_program(halving(guard, older), cache=cache, lanes=1) for guard in (True, False)]
    for z in (0.5, 2.0, 0.25):
        (a, slope), (b, expected) = (kernel.gradient([z], [1.0]) for kernel in kernels)
        assert a["end"] == b["end"]
        assert slope == expected
    assert (plan(halving(True, older), ["end"]).guarding is None) == older


def test_a_guard_that_the_driver_cannot_follow_is_refused() -> None:
    program = halving(True)
    tables: Any = {name: ([], []) for name in ("body", "again", "back_body")}
    for change, why in (
        ({"guard": Place(0, 2)}, "the word of its guard"),
        ({"otherwise": ()}, "what stands for it"),
        ({"otherwise": (Place(0, 3),)}, "cannot stand for"),
    ):
        calls = (program.body[0], replace(program.body[1], **change), *program.body[2:])
        with pytest.raises(ProgramError, match=why):
            guarding_of(replace(program, body=calls), tables)
    moved = program.body[1].outputs[0]
    calls = (*program.body[:2], replace(program.body[2], guard=moved), *program.body[3:])
    with pytest.raises(ProgramError, match="move: it has a guard, and comes before all guards are computed"):
        guarding_of(replace(program, body=calls), tables)


@few("lanes", [1, 4], 1)
def test_sections_of_which_nothing_is_left(lanes: int, cache: Cache) -> None:
    kernels = [compile_program(guarded_sections(guard), cache=cache, lanes=lanes) for guard in (True, False)]
    z = np.array([[0.4, a, b] for a in (-1, 1) for b in (-1, 1)] * 3)
    (a, slope), (b, expected) = (kernel.gradient(z, [1.0]) for kernel in kernels)
    assert a["out"].tolist() == b["out"].tolist()
    assert slope.tolist() == expected.tolist()
    assert len(np.unique(a["out"])) == 3
