"""A program as a plain C file, compiled and called."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from symphys.codegen import Program
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
