"""C compilers and the processor that they compile for: found, asked for their version and features, run in parallel.

Every failure is one clear line.
"""

from __future__ import annotations

import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.processes import ADVICE, ELSEWHERE, run, run_all
from symphys.codegen.toolchain.source_file import SourceFile
from symphys.records import dataclass

AVX2 = ("avx2", "fma", "f16c", "bmi1", "bmi2")
AVX512 = ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl")
LEVELS: tuple[tuple[str, int, tuple[str, ...]], ...] = (
    ("x86-64-v4", 64, AVX2 + AVX512),
    ("x86-64-v3", 32, AVX2),
    ("x86-64", 16, ()),
)
"""Architecture, bytes of a vector, and the features that the processor must have."""
FLAGS = (
    *("-std=gnu11", "-O2", "-fPIC", "-fvisibility=hidden", "-w"),
    *("-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off"),
)
"""No -ffast-math: a NaN stays one, and sums keep their order. Products are fused where the C says so."""
STRAIGHT = (
    *("-fno-tree-fre", "-fno-tree-pre", "-fno-gcse", "-fno-code-hoisting", "-fno-tree-vrp", "-fno-tree-pta"),
    *("-fno-tree-dse", "-fno-dse", "-fno-rerun-cse-after-loop", "-fno-crossjumping"),
    *("-fno-ipa-icf", "-fno-ipa-sra", "-fno-ipa-cp", "-fno-ipa-ra"),
    *("-fno-tree-ccp", "-fno-tree-bit-ccp", "-fno-tree-dominator-opts"),
    *("-fdisable-rtl-cse1", "-fdisable-rtl-postreload"),
)
"""More flags of gcc where functions are straight lines of values, each computed once: nearly half less to compile."""
LIGHT = ("-O1",)
"""More flags where little time is spent: half to compile (graphs.c)."""
BROADCASTS = ("-O1", "-fdisable-rtl-combine")
"""More flags of gcc where numbers are read into all lanes: its combiner takes seven eighths of its time there, and more
than -O1 gives slower code (Jacobians of a hopper: 27 s in place of 71, and 0.88 of the time of a call)."""
NARROW = ("-fno-tree-vectorize", "-fno-tree-slp-vectorize")
"""More flags where a lane is a number, or a vector is short: packing several into one takes longer."""
COMPILE_TIMEOUT = 600.0
"""[s] Timeout of a compiler for one file, far above what any kernel needs."""
VERSION_TIMEOUT = 60.0
"""[s] Timeout for its version; ziglang unpacks itself on its first call."""


@dataclass(frozen=True)
class Processor:
    """The processor that kernels are compiled for.

    Attributes:
        architecture: its name.
        vector_bytes: size of a vector register.
        features: what compilers may use beyond their default.
    """

    architecture: str
    vector_bytes: int
    features: tuple[str, ...] = ()

    def flags(self) -> tuple[str, ...]:
        """Return the features for gcc and clang, one by one: older ones do not know the architectures by name."""
        wide = ("-mprefer-vector-width=512",) if self.vector_bytes == 64 else ()
        return (*(f"-m{name.replace('bmi1', 'bmi')}" for name in self.features), *wide)

    def lanes(self, single: bool) -> int:
        """Return how many numbers a vector register holds."""
        return self.vector_bytes // (4 if single else 8)


@cache
def processor() -> Processor:
    """Return the processor of this machine."""
    machine = platform.machine().lower()
    if machine in ("x86_64", "amd64"):
        features = _features()
        return next(Processor(*level) for level in LEVELS if set(level[2]) <= features)
    return Processor(machine, 16)


def _features() -> set[str]:
    """Return the features that the system lists; none if it lists none."""
    try:
        if platform.system() == "Darwin":
            names = ["machdep.cpu.features", "machdep.cpu.leaf7_features"]
            listed = subprocess.run(["sysctl", "-n", *names], capture_output=True, text=True, timeout=10, check=False)
            return set(listed.stdout.lower().replace(".", "").split())
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return set()
    return {word for line in lines if line.startswith("flags") for word in line.split(":", 1)[1].split()}


@dataclass(frozen=True)
class Compiler:
    """A C compiler.

    Attributes:
        command: how it is called.
        version: the first line of its version message; its path is in the command.
        gnu: whether it is gcc.
    """

    command: tuple[str, ...]
    version: str
    gnu: bool = False

    def flags(self, processor: Processor) -> tuple[str, ...]:
        """Return the flags of every C file, which are part of a kernel's identity."""
        if "ziglang" in self.command and processor.features:  # its default is the machine's own processor
            cpu = processor.architecture.replace("-", "_")
            return (*FLAGS, f"-mcpu={cpu}", "-mprefer-vector-width=512", *own_flags())
        return (*FLAGS, *processor.flags(), *own_flags())

    def build(self, sources: Sequence[SourceFile], flags: Sequence[str], folder: Path) -> Path:
        """Compile each source in a process of its own, link them, and return the shared library."""
        objects = [folder / f"part{i}.o" for i in range(len(sources))]
        commands = []
        for source, target in zip(sources, objects, strict=True):
            file = target.with_suffix(".c")
            _write(file, source.text)
            straight, broadcasts = (STRAIGHT if source.straight else ()), (BROADCASTS if source.broadcasts else ())
            plain = (*(NARROW if source.narrow else ()), *(LIGHT if source.light else ()))
            extra = (*plain, *((*straight, *broadcasts) if self.gnu else ()))
            commands.append([*self.command, *flags, *extra, *own_flags(), "-c", str(file), "-o", str(target)])
        run_all(commands, COMPILE_TIMEOUT, processors(), folder)
        library = folder / "kernel.so"
        run([*self.command, *flags, "-shared", *map(str, objects), "-o", str(library), "-lm"], COMPILE_TIMEOUT, folder)
        return library


def own_flags() -> tuple[str, ...]:
    """Return the flags of $SYMPHYS_CFLAGS, which come last."""
    return tuple(shlex.split(os.environ.get("SYMPHYS_CFLAGS", "")))


def processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def find_compiler() -> Compiler:
    """Find the compiler of $CC, else gcc, clang, cc or the ziglang package; KernelUnavailable if there is none."""
    wanted = os.environ.get("CC", "").strip()
    if wanted:
        return _compiler_of(tuple(shlex.split(wanted)), named=True)
    for name in ("gcc", "clang", "cc"):
        path = shutil.which(name)
        if path:
            return _compiler_of((path,), named=False)
    if importlib.util.find_spec("ziglang"):
        return _compiler_of((sys.executable, "-m", "ziglang", "cc"), named=False)
    raise KernelUnavailable(f"no C compiler was found: {ADVICE}")


@cache
def _compiler_of(command: tuple[str, ...], named: bool) -> Compiler:
    path = shutil.which(command[0])
    if path is None:
        raise KernelUnavailable(f"the compiler {command[0]!r} that CC names was not found: {ADVICE}")
    command = (path, *command[1:])
    said = run([*command, "--version"], VERSION_TIMEOUT)
    version = said.partition("\n")[0] or "unknown version"
    return Compiler(command, version, gnu="Free Software Foundation" in said)


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise KernelUnavailable(
            f"cannot write the sources of a kernel to {path.parent}: {error.strerror}; {ELSEWHERE}"
        ) from error
