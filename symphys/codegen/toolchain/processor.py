"""What the processor can do: how many numbers it computes at once, and the compiler flags that let it."""

from __future__ import annotations

import platform
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

AVX2 = ("avx2", "fma", "f16c", "bmi1", "bmi2")
AVX512 = ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl")
LEVELS: tuple[tuple[str, int, tuple[str, ...]], ...] = (
    ("x86-64-v4", 64, AVX2 + AVX512),
    ("x86-64-v3", 32, AVX2),
    ("x86-64", 16, ()),
)
"""Architecture, bytes of a vector, and what the processor must say that it has."""


@dataclass(frozen=True)
class Processor:
    """A target.

    Attributes:
        architecture: its name.
        vector_bytes: size of a vector register.
        features: what compilers may use beyond their default.
    """

    architecture: str
    vector_bytes: int
    features: tuple[str, ...] = ()

    def flags(self) -> tuple[str, ...]:
        """The features for gcc and clang, one by one: older ones do not know the architectures by name."""
        wide = ("-mprefer-vector-width=512",) if self.vector_bytes == 64 else ()
        return (*(f"-m{name.replace('bmi1', 'bmi')}" for name in self.features), *wide)

    def lanes(self, single: bool) -> int:
        """Numbers in a vector."""
        return self.vector_bytes // (4 if single else 8)


@cache
def processor() -> Processor:
    """This machine's."""
    machine = platform.machine().lower()
    if machine in ("x86_64", "amd64"):
        features = _features()
        return next(Processor(*level) for level in LEVELS if set(level[2]) <= features)
    return Processor(machine, 16)


def _features() -> set[str]:
    """The features that the system lists; none if it lists none."""
    try:
        if platform.system() == "Darwin":
            names = ["machdep.cpu.features", "machdep.cpu.leaf7_features"]
            listed = subprocess.run(["sysctl", "-n", *names], capture_output=True, text=True, timeout=10, check=False)
            return set(listed.stdout.lower().replace(".", "").split())
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return set()
    return {word for line in lines if line.startswith("flags") for word in line.split(":", 1)[1].split()}
