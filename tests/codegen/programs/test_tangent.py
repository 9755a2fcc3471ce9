"""Forward mode: derivatives along directions are those of the adjoints, and values stay what they were."""

from __future__ import annotations

import numpy as np
import pytest

from symphys.codegen import Cache, Kernel, compile_program, interpret
from symphys.codegen.program.tangent import tangent_name, tangent_program


@pytest.mark.parametrize("directions", [1, 3])
def test_derivatives_are_those_of_the_adjoint(kernel: Kernel, directions: int) -> None:
    program, name = kernel.program, kernel.seeded[0]
    rng = np.random.default_rng(0)
    z, given = rng.normal(size=program.z.size), np.zeros(program.parameters.size)
    along = rng.normal(size=(len(z), directions))
    forward = tangent_program(program, directions, [name])
    found = interpret(forward, z, np.concatenate([given, along.ravel()]))
    np.testing.assert_array_equal(found[name], interpret(program, z, given)[name])
    expected = kernel.jacobian(z, name, given) @ along
    assert found[tangent_name(name)].reshape(-1, directions) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.slow
def test_a_compiled_one_is_the_interpreted_one(kernel: Kernel, cache: Cache) -> None:
    program, name = kernel.program, kernel.seeded[0]
    forward = tangent_program(program, 2, [name])
    z = np.random.default_rng(1).normal(size=(5, program.z.size))
    given = np.random.default_rng(2).normal(size=(5, forward.parameters.size))
    found = compile_program(forward, seeded=(), cache=cache, threads=1).forward(z, given)
    for row in range(5):
        expected = interpret(forward, z[row], given[row])
        assert found[tangent_name(name)][row] == pytest.approx(expected[tangent_name(name)], rel=1e-12, abs=1e-12)
