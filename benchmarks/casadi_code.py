"""Casadi's own C of a function, compiled: what kernels are measured against."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

import casadi as ca

from symphys.codegen.toolchain.compiler import find_compiler


@contextmanager
def compiled_by_casadi(function: ca.Function, level: str = "-O2") -> Iterator[tuple[ca.Function, float]]:
    """The function as machine code, and the seconds that the compiler took."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path.cwd()
        os.chdir(folder)  # casadi generates into the current folder only
        try:
            function.generate("code.c")
            began = perf_counter()
            command = [*find_compiler().command, level, "-march=native", "-w", "-fPIC", "-shared", "code.c"]
            subprocess.run([*command, "-o", "code.so"], check=True)
            seconds = perf_counter() - began
            yield ca.external(function.name(), str(Path(folder) / "code.so")), seconds
        finally:
            os.chdir(here)
