"""A device leaves out calls without effect: the same bits as with all calls, and as on the processor."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from fakes.emulated import Emulated, needs_compiler
from tools.repeats import few
from worlds.guarded import guarded_sections, halving, program_of, whole

from symphys.codegen import Cache, FunctionCall, MemoryLayout, Place, Program, compile_program
from symphys.codegen.cuda import compile_on
from symphys.codegen.cuda.kernel import schedules
from symphys.codegen.emit.alternatives import LEFT_OUT
from symphys.codegen.emit.plan import FAST_MEMORY, plan

pytestmark = needs_compiler


def entries_of(program: Program, phase: str) -> list[int]:
    """The first words of all entries of a phase."""
    words = schedules(plan(program, ["end"], FAST_MEMORY, noted=False), program, 1)[phase].entries
    found, at = [], 0
    while at < len(words):
        found.append(int(words[at]))
        at += int(words[at + 1])
    return found


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["spheres", "capsules", "a box", "soft"])
@pytest.mark.parametrize("warps", [4, 1])
def test_a_heap_is_the_processors_and_that_of_all_calls(name: str, warps: int, tmp_path: Path, cache: Cache) -> None:
    program, soft = program_of(name, duration=0.1), name == "soft"
    here = compile_program(program, cache=cache, threads=1, seeded=("merit",), lanes=4)
    z = np.random.default_rng(2).uniform(-2, 2, (7, program.z.size))
    wanted, slopes = here.gradient(z, [1.0], [0.0])
    found = []
    for each, folder in ((program, "with"), (whole(program), "without")):
        device = Emulated(tmp_path / folder, backwards=folder == "with")
        found.append(compile_on(device, each, seeded=("merit",), warps=warps).gradient(z, [1.0], [0.0]))
    (values, gradient), (others, expected) = found
    for name, value in wanted.items():
        np.testing.assert_array_equal(values[name], value)
        np.testing.assert_array_equal(others[name], value)
    np.testing.assert_array_equal(gradient, expected)
    # starts that are off by 1e-15 change gradients of the soft heap by up to 1e-7 of the largest
    np.testing.assert_allclose(gradient, slopes, rtol=0, atol=(1e-7 if soft else 1e-9) * np.abs(slopes).max())


@pytest.mark.slow
@few("make", [halving, guarded_sections], 1)
def test_small_programs(make: Callable[[bool], Program], tmp_path: Path) -> None:
    programs = [make(guard) for guard in (True, False)]
    kernels = [compile_on(Emulated(tmp_path / str(i)), each, warps=2) for i, each in enumerate(programs)]
    z = np.random.default_rng(0).choice([-1.0, 0.4, 2.0], (40, programs[0].z.size))
    (values, gradient), (others, expected) = (kernel.gradient(z, [1.0]) for kernel in kernels)
    assert len(np.unique(gradient)) > 1
    for name, value in others.items():
        np.testing.assert_array_equal(values[name], value)
    np.testing.assert_array_equal(gradient, expected)


def poisoned(twice: bool = False) -> Program:
    """x, moved by the guard times a number that is none where x is negative; ``twice``: to two results."""
    at = MemoryLayout()
    z, word, moved, other, out = at.take(2), at.take(1), at.take(1), at.take(1), at.take(1)
    x, y, g = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("g")
    both = ca.SX.sym("z", 2)
    point = Place(z.offset, 1)
    body = (
        FunctionCall(ca.Function("split", [both], [both[1] > 0]), (z,), (word,)),
        FunctionCall(
            ca.Function("move", [g, x], [x + g * ca.log(x), x - g * x]),
            (word, point),
            (moved, other),
            guard=word,
            otherwise=(point, point if twice else None),
        ),
        FunctionCall(ca.Function("last", [x, y], [x * x + y]), (moved, other if twice else moved), (out,), True),
    )
    return Program(at.size, z, Place(0, 0), 1, {"end": out}, body=body, zeroed=(out,))


@pytest.mark.slow
def test_calls_are_left_out_where_no_robot_of_a_block_needs_them(device: Emulated) -> None:
    """A call that runs makes what is none of a negative number, even if its guard is 0."""
    kernel = compile_on(device, poisoned(), warps=2)
    z = np.array(
        [[-0.5, -1.0], [2.0, -1.0], [-3.0, -1.0], [4.0, -1.0], [-0.5, -1.0], [2.0, 1.0], [3.0, 1.0], [1.0, 1.0]]
    )
    values, gradient = kernel.gradient(z, [1.0])
    end = values["end"].ravel()
    assert end[:4].tolist() == (z[:4, 0] ** 2 + z[:4, 0]).tolist()
    assert gradient[:4, 0].tolist() == (2 * z[:4, 0] + 1).tolist()
    assert np.isnan(end[4]) and np.isfinite(end[5:]).all()


def test_what_would_add_up_adjoints_in_another_order_is_not_left_out() -> None:
    """Two results that stand for the same words: their adjoints are added before they are added to another."""
    assert LEFT_OUT in entries_of(poisoned(), "body") and LEFT_OUT in entries_of(poisoned(), "back_body")
    assert LEFT_OUT not in entries_of(poisoned(twice=True), "body")


def test_guards_are_computed_again_backwards() -> None:
    """Even where no adjoint reads them; the processor's driver notes them."""
    at = MemoryLayout()
    z, given, word, moved, out = (at.take(1) for _ in range(5))
    x, y, g = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("g")
    body = (
        FunctionCall(ca.Function("above", [y], [y > 1]), (given,), (word,)),
        FunctionCall(ca.Function("move", [g, x], [x + g]), (word, z), (moved,), guard=word, otherwise=(z,)),
        FunctionCall(ca.Function("keep", [x], [x]), (moved,), (out,), accumulate=True),
    )
    program = Program(at.size, z, given, 1, {"end": out}, body=body, zeroed=(out,))
    calls = [plan(program, ["end"], FAST_MEMORY, noted=noted).tables["again"][0] for noted in (True, False)]
    assert calls == [0, 1]
