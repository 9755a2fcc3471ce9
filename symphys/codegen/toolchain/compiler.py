"""C compilers: found, asked for their version, run in parallel; every way to fail is one clear line."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.processes import ADVICE, ELSEWHERE, run, run_all
from symphys.codegen.toolchain.processor import Processor

if TYPE_CHECKING:
    from symphys.codegen.emit.source import SourceFile

FLAGS = (
    *("-std=gnu11", "-O2", "-fPIC", "-fvisibility=hidden", "-w"),
    *("-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off"),
)
"""No -ffast-math: a NaN stays one, and sums keep their order. Products are fused where the C says so."""
STRAIGHT = (
    *("-fno-tree-fre", "-fno-tree-pre", "-fno-gcse", "-fno-code-hoisting", "-fno-tree-vrp", "-fno-tree-pta"),
    *("-fno-tree-dse", "-fno-dse", "-fno-rerun-cse-after-loop", "-fno-crossjumping"),
    *("-fno-ipa-icf", "-fno-ipa-sra", "-fno-ipa-cp", "-fno-ipa-ra"),
)
"""More flags of gcc where functions are straight lines of values, each computed once: a third less to compile."""
GATHERS = ("-fdisable-rtl-combine",)
"""More flags of gcc where vectors are put together word by word: the combiner takes seven eighths of its time there."""
NARROW = ("-fno-tree-vectorize", "-fno-tree-slp-vectorize")
"""More flags where a lane is a number, or a vector is short: packing several into one takes longer."""
LIMIT = 600.0
"""Seconds that a compiler may take for one file: far more than any kernel needs; one that hangs is stopped."""
ANSWER = 60.0
"""Seconds in which it must say its version; ziglang unpacks itself on its first call."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler.

    Attributes:
        command: how it is called.
        version: first line of what it says of itself; where it lies is in the command.
        gnu: whether it is gcc.
    """

    command: tuple[str, ...]
    version: str
    gnu: bool = False

    def flags(self, processor: Processor) -> tuple[str, ...]:
        """The flags of every C file: they are part of what a kernel is."""
        if "ziglang" in self.command and processor.features:  # its default is the machine's own processor
            return (*FLAGS, f"-mcpu={processor.architecture.replace('-', '_')}", "-mprefer-vector-width=512")
        return (*FLAGS, *processor.flags())

    def build(self, sources: Sequence[SourceFile], flags: Sequence[str], folder: Path) -> Path:
        """Compile each source in a process of its own, link them, and return the shared library."""
        objects = [folder / f"part{i}.o" for i in range(len(sources))]
        commands = []
        for source, target in zip(sources, objects, strict=True):
            file = target.with_suffix(".c")
            _write(file, source.text)
            commands.append([*self.command, *flags, *self._extra(source), "-c", str(file), "-o", str(target)])
        run_all(commands, LIMIT, processors(), folder)
        library = folder / "kernel.so"
        run([*self.command, *flags, "-shared", *map(str, objects), "-o", str(library), "-lm"], LIMIT, folder)
        return library

    def _extra(self, source: SourceFile) -> tuple[str, ...]:
        straight, gathers = (STRAIGHT if source.straight else ()), (GATHERS if source.gathers else ())
        return (*(NARROW if source.narrow else ()), *((*straight, *gathers) if self.gnu else ()))


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def find_compiler() -> Compiler:
    """The compiler of $CC, else gcc, clang, cc or the ziglang package; KernelUnavailable if there is none."""
    wanted = os.environ.get("CC", "").strip()
    if wanted:
        return _asked(tuple(shlex.split(wanted)), named=True)
    for name in ("gcc", "clang", "cc"):
        path = shutil.which(name)
        if path:
            return _asked((path,), named=False)
    if importlib.util.find_spec("ziglang"):
        return _asked((sys.executable, "-m", "ziglang", "cc"), named=False)
    raise KernelUnavailable(f"no C compiler was found: {ADVICE}")


@cache
def _asked(command: tuple[str, ...], named: bool) -> Compiler:
    path = shutil.which(command[0])
    if path is None:
        raise KernelUnavailable(f"the compiler {command[0]!r} that CC names was not found: {ADVICE}")
    command = (path, *command[1:])
    said = run([*command, "--version"], ANSWER)
    version = said.partition("\n")[0] or "unknown version"
    return Compiler(command, version, gnu="Free Software Foundation" in said)


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise KernelUnavailable(
            f"cannot write the sources of a kernel to {path.parent}: {error.strerror}; {ELSEWHERE}"
        ) from error
