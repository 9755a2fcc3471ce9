"""The plain C file gives what the vector kernel gives: values to the bit, gradients but for fused products."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import programs
import pytest
from operations import alone, every_operation, long_function
from repeats import thorough

from symphys.codegen import Cache, Kernel, KernelUnavailable, Program, compile_program
from symphys.codegen.emit.plain import plain_source
from symphys.codegen.toolchain.compiler import find_compiler

CALL = """
void call(const double *z, const double *p, const double *seed, double *outputs, double *gradient, double *work) {
  const batch one = {1, {z, 0}, {p, 0}, {seed, 0}, outputs, gradient, 0, 0, 0, 0, 0};
  evaluate(&PROGRAM, &one, work);
}
"""


def plain(program: Program, folder: Path) -> Any:
    """(z, parameters, seed) -> (outputs, gradient) by the plain file."""
    source = plain_source(program, tuple(program.outputs), {})
    (folder / "plain.c").write_text(source.text + CALL, "utf-8")
    flags = ["-std=c99", "-O2", "-Wall", "-pedantic", "-Werror", "-fPIC", "-shared"]
    command = [*find_compiler().command, *flags, str(folder / "plain.c"), "-o", str(folder / "plain.so"), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    library = ctypes.CDLL(str(folder / "plain.so"))

    def call(*given: Any) -> tuple[Any, Any]:
        outputs = np.empty(sum(place.size for place in program.outputs.values()))
        gradient, work = np.empty(program.z.size), np.empty(source.memory)
        arrays = [*(np.array(x, dtype=float) for x in given), outputs, gradient, work]
        library.call(*(array.ctypes.data_as(ctypes.c_void_p) for array in arrays))
        return outputs, gradient

    return call


@pytest.mark.parametrize("name", ["pendulum", "chain", "operations", thorough("long")])
def test_it_gives_what_the_kernel_gives(name: str, cache: Cache, tmp_path: Path) -> None:
    program = {
        "pendulum": programs.pendulum,
        "chain": programs.chain,
        "operations": lambda: alone(every_operation()),
        "long": lambda: alone([long_function()]),
    }[name]()
    try:
        kernel: Kernel = compile_program(program, cache=cache, threads=1)
    except KernelUnavailable as error:
        pytest.skip(str(error))
    call, random = plain(program, tmp_path), np.random.default_rng(3)
    for _ in range(3):
        z, parameters = random.normal(size=program.z.size), np.full(program.parameters.size, 9.81)
        seed = random.normal(size=sum(place.size for place in program.outputs.values()))
        values, slope = kernel.gradient(z, seed, parameters)
        outputs, gradient = call(z, parameters, seed)
        np.testing.assert_array_equal(outputs, np.concatenate([value[0] for value in values.values()]))
        np.testing.assert_allclose(gradient, slope[0], rtol=1e-11, atol=1e-11)
