"""A device that is this processor: the kernels' own text, compiled as C++ through a shim of CUDA's words."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import DTypeLike, NDArray

ROOM = Path(__file__).parent / "cuda"
FLAGS = ("-std=c++17", "-O0", "-fPIC", "-w", "-ffp-contract=off", "-fno-math-errno")
needs_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler stands in for CUDA's")


class Emulated:
    """See ``symphys.cuda.Device``; ``backwards``: threads take their turns from the last to the first."""

    name, lanes = "this processor", 4

    def __init__(self, folder: Path, backwards: bool = False, room: int = 2**33) -> None:
        """``folder``: for what is compiled; ``room``: bytes that an array can have."""
        self.folder, self.backwards, self.room = folder, backwards, room
        self.launched: list[str] = []

    def load(self, texts: Sequence[str]) -> tuple[Any, str, bool, str]:
        """Compile, each text by itself."""
        self.folder.mkdir(exist_ok=True)
        files = [self.folder / f"part{number}.cpp" for number in range(len(texts))]
        for file, text in zip(files, texts, strict=True):
            file.write_text(f'#include "{ROOM / "shim.h"}"\n{text}')
        with ThreadPoolExecutor(2) as pool:
            objects = list(pool.map(compiled, [*files, ROOM / "shim.cpp"], [self.folder] * (len(files) + 1)))
        library = self.folder / "kernel.so"
        subprocess.run(["g++", "-shared", *map(str, objects), "-o", str(library)], check=True)
        return ctypes.CDLL(str(library)), "g++", False, ""

    def free(self) -> int:
        """As it was told."""
        return self.room

    def put(self, values: NDArray[Any]) -> NDArray[Any]:
        """A copy."""
        return np.array(values, order="C")

    def empty(self, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """Memory in which what is not written is not a number."""
        return np.full(shape, np.nan, dtype)

    def address(self, array: NDArray[Any]) -> int:
        """Of its first word."""
        return array.ctypes.data

    def get(self, array: NDArray[Any]) -> NDArray[Any]:
        """A copy."""
        return array.copy()

    def launch(self, module: Any, name: str, blocks: int, threads: tuple[int, int], job: NDArray[Any]) -> None:
        """Run it at once."""
        self.launched.append(name)
        kernel = ctypes.cast(getattr(module, name), ctypes.c_void_p)
        address = ctypes.c_void_p(job.ctypes.data)
        uneven = module.launch(kernel, blocks, *threads, address, int(self.backwards))
        assert not uneven, f"the threads of {name} meet different numbers of barriers"

    def wait(self) -> None:
        """Nothing goes on."""


def compiled(file: Path, folder: Path) -> Path:
    """The object of a file."""
    target = folder / file.with_suffix(".o").name
    subprocess.run(["g++", *FLAGS, "-c", str(file), "-o", str(target)], check=True)
    return target
