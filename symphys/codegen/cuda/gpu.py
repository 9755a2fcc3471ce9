"""A GPU by CuPy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from symphys.codegen.cuda.compiler import ADVICE, image
from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.build import temporary_folder
from symphys.codegen.toolchain.cache import Cache, default_cache

RESERVED_BYTES = 2**28
"""[bytes] left to others, and to what a launch needs: stacks of all resident threads."""

FIRST = "begin"
"""A kernel that all modules have."""


class Gpu:
    """See ``Device``."""

    def __init__(self, cupy: Any, cache: Cache) -> None:
        """Use ``find_gpu``."""
        self.cupy, self.cache = cupy, cache
        properties = cupy.cuda.runtime.getDeviceProperties(cupy.cuda.runtime.getDevice())
        self.name, self.lanes = properties["name"].decode(), int(properties["warpSize"])
        self.architecture = f"sm_{properties['major']}{properties['minor']}"

    def load(self, texts: Sequence[str]) -> tuple[Any, str, bool, str]:
        """Implement ``Device.load``."""
        with temporary_folder("symphys-cuda-") as folder:
            found = image(texts, self.architecture, self.cache, Path(folder))
            with self._told():
                module = self.cupy.RawModule(path=str(found.path))
                module.get_function(FIRST)  # CuPy reads the file when it is asked for the first kernel
        return module, found.compiler, found.cached, found.note

    def free(self) -> int:
        """Implement ``Device.free``."""
        self.cupy.get_default_memory_pool().free_all_blocks()
        return max(0, int(self.cupy.cuda.runtime.memGetInfo()[0]) - RESERVED_BYTES)

    def put(self, values: NDArray[Any]) -> Any:
        """Implement ``Device.put``."""
        with self._told():
            return self.cupy.asarray(np.ascontiguousarray(values))

    def empty(self, shape: tuple[int, ...], dtype: DTypeLike) -> Any:
        """Implement ``Device.empty``."""
        with self._told():
            return self.cupy.empty(shape, dtype)

    def lacks(self) -> str:
        """Implement ``Device.lacks``: CuPy looks for cuBLAS at the first product."""
        try:
            array = self.put(np.ones((1, 1)))
            np.tanh(np.matmul(array, array))
        except (ImportError, RuntimeError, self.cupy.cuda.compiler.CompileException) as error:
            return f"CuPy cannot multiply on {self.name} ({' '.join(str(error).split())}): {ADVICE}"
        return ""

    def address(self, array: Any) -> int:
        """Implement ``Device.address``."""
        return int(array.data.ptr)

    def get(self, array: Any) -> NDArray[Any]:
        """Implement ``Device.get``."""
        with self._told():
            return np.asarray(self.cupy.asnumpy(array))

    def launch(self, module: Any, name: str, blocks: int, threads: tuple[int, int], job: Any) -> None:
        """Implement ``Device.launch``."""
        with self._told():
            module.get_function(name)((blocks,), threads, (job,))

    def wait(self) -> None:
        """Implement ``Device.wait``."""
        with self._told():
            self.cupy.cuda.get_current_stream().synchronize()

    @contextmanager
    def _told(self) -> Iterator[None]:
        """CUDA's errors in a line of ours."""
        cuda = self.cupy.cuda
        try:
            yield
        except (
            cuda.memory.OutOfMemoryError,
            cuda.runtime.CUDARuntimeError,
            cuda.driver.CUDADriverError,
        ) as error:
            raise KernelUnavailable(f"{self.name} failed: {' '.join(str(error).split())}") from error


def find_gpu(cache: Cache | None = None) -> Gpu:
    """The GPU that CUDA names first; KernelUnavailable says what is missing."""
    try:
        import cupy
    except ImportError as error:
        raise KernelUnavailable(f"no CuPy to reach a GPU with: {ADVICE}") from error
    try:
        count = cupy.cuda.runtime.getDeviceCount()
    except cupy.cuda.runtime.CUDARuntimeError as error:
        raise KernelUnavailable(f"no GPU that CUDA can use: {error}") from error
    if not count:
        raise KernelUnavailable("no GPU that CUDA can use")
    return Gpu(cupy, cache or default_cache())
