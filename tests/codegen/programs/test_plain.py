"""The plain C file gives what the vector kernel gives: values to the bit, gradients but for fused products."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tools.plain_c import plain
from tools.repeats import thorough
from worlds import programs
from worlds.operations import alone, every_operation, long_function

from symphys.codegen import Cache, Kernel, compile_program


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pendulum", "chain", "operations", thorough("long")])
def test_it_gives_what_the_kernel_gives(name: str, cache: Cache, tmp_path: Path) -> None:
    program = {
        "pendulum": programs.pendulum,
        "chain": programs.chain,
        "operations": lambda: alone(every_operation()),
        "long": lambda: alone([long_function()]),
    }[name]()
    kernel: Kernel = compile_program(program, cache=cache, threads=1)
    call, random = plain(program, tmp_path), np.random.default_rng(3)
    for _ in range(3):
        z, parameters = random.normal(size=program.z.size), np.full(program.parameters.size, 9.81)
        seed = random.normal(size=sum(place.size for place in program.outputs.values()))
        values, slope = kernel.gradient(z, seed, parameters)
        outputs, gradient = call(z, parameters, seed)
        np.testing.assert_array_equal(outputs, np.concatenate([value[0] for value in values.values()]))
        np.testing.assert_allclose(gradient, slope[0], rtol=1e-11, atol=1e-11)
