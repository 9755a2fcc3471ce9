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
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import DTypeLike, NDArray

ROOM = Path(__file__).parents[1] / "codegen" / "cuda"
FLAGS = ("-std=c++17", "-O0", "-fPIC", "-w", "-ffp-contract=off", "-fno-math-errno")
needs_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler stands in for CUDA's")


class Emulated:
    """See ``symphys.codegen.cuda.Device``; ``backwards``: threads take their turns from the last to the first."""

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

    def lacks(self) -> str:
        """Nothing."""
        return ""

    def address(self, array: NDArray[Any]) -> int:
        """Of its first word."""
        return array.ctypes.data

    def get(self, array: NDArray[Any]) -> NDArray[Any]:
        """A copy."""
        return array.copy()

    def launch(self, module: Any, name: str, blocks: int, threads: tuple[int, int], job: Any) -> None:
        """Run it at once."""
        self.launched.append(name)
        kernel = ctypes.cast(getattr(module, name), ctypes.c_void_p)
        address = ctypes.c_void_p(self.address(job))
        uneven = module.launch(kernel, blocks, *threads, address, int(self.backwards))
        assert not uneven, f"the threads of {name} meet different numbers of barriers"

    def wait(self) -> None:
        """Nothing goes on."""


class Held(NDArrayOperatorsMixin):
    """An array that stays where it is, as CuPy's: numpy's functions take it, numpy's arrays do not mix with it."""

    def __init__(self, array: NDArray[Any]) -> None:
        self.array = array
        self.shape, self.dtype, self.size = array.shape, array.dtype, array.size

    def __array__(self, *given: Any, **named: Any) -> NDArray[Any]:
        raise TypeError("an array of a device is not turned into one of numpy's by itself")

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **named: Any) -> Any:
        if any(isinstance(value, np.ndarray) and value.ndim for value in inputs):
            raise TypeError("an array of a device and one of numpy's")
        named |= {"out": tuple(map(unheld, named["out"]))} if "out" in named else {}
        return held(getattr(ufunc, method)(*map(unheld, inputs), **named))

    def __array_function__(self, function: Any, types: Any, inputs: Any, named: Any) -> Any:
        return held(function(*([unheld(value) for value in each] for each in inputs), **named))

    def __getitem__(self, key: Any) -> Any:
        return held(self.array[key])

    def __setitem__(self, key: Any, value: Any) -> None:
        if isinstance(value, np.ndarray):
            raise TypeError("an array of a device and one of numpy's")
        self.array[key] = unheld(value)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.array, name)
        return (lambda *given, **named: held(found(*given, **named))) if callable(found) else held(found)


class Remote(Emulated):
    """A device whose arrays are ``Held``."""

    def put(self, values: NDArray[Any]) -> Any:
        """A copy."""
        return Held(super().put(values))

    def empty(self, shape: tuple[int, ...], dtype: DTypeLike) -> Any:
        """See ``Emulated``."""
        return Held(super().empty(shape, dtype))

    def address(self, array: Any) -> int:
        """See ``Emulated``."""
        return super().address(array.array)

    def get(self, array: Any) -> NDArray[Any]:
        """See ``Emulated``."""
        return super().get(array.array)


def held(value: Any) -> Any:
    """Arrays held, all else as it is."""
    return Held(value) if isinstance(value, np.ndarray) else value


def unheld(value: Any) -> Any:
    """The array that is held."""
    return value.array if isinstance(value, Held) else value


def compiled(file: Path, folder: Path) -> Path:
    """The object of a file."""
    target = folder / file.with_suffix(".o").name
    subprocess.run(["g++", *FLAGS, "-c", str(file), "-o", str(target)], check=True)
    return target
