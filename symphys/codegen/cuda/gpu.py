"""A GPU by CuPy, and the images that it loads: CUDA C++ compiled by NVRTC and linked by nvJitLink, without a GPU."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.cache import KINDS, Cache, default_cache
from symphys.codegen.toolchain.compiler import processors
from symphys.codegen.toolchain.libraries import temporary_folder
from symphys.codegen.toolchain.processes import ELSEWHERE
from symphys.errors import install_advice
from symphys.records import dataclass

RESERVED_BYTES = 2**28
"""[bytes] left to others, and to what a launch needs: stacks of all resident threads."""
FIRST = "begin"
"""A kernel that all modules have."""
ADVICE = install_advice("cuda")
FLAGS = ("--std=c++17", "--fmad=false", "--relocatable-device-code=true")
"""Without fused products and sums, so that numbers are those of processors but for library functions."""


@dataclass(frozen=True)
class Image:
    """A linked image that a device loads.

    Attributes:
        path: of the file.
        compiler: its name and version.
        cached: whether it came from the cache.
        note: what the user should know, or empty.
    """

    path: Path
    compiler: str
    cached: bool
    note: str = ""


def image(texts: Sequence[str], architecture: str, cache: Cache, folder: Path) -> Image:
    """Return linked texts for an architecture such as "sm_90", from the cache or compiled.

    ``folder`` if the cache refuses.
    """
    nvrtc, _ = _libraries()
    version = "nvrtc {}.{}".format(*_checked(nvrtc, nvrtc.nvrtcVersion()))
    own = replace(cache, suffix=KINDS[1])
    key = hashlib.sha256("\0".join([*texts, version, architecture, *FLAGS]).encode()).hexdigest()[:32]
    if (path := own.find(key)) is not None:
        return Image(path, version, cached=True)
    with own.building(key):
        if (path := own.find(key)) is not None:  # another process may have built it meanwhile
            return Image(path, version, cached=True)
        built = folder / f"{key}.cubin"
        content = linked([part for part, _ in compiled(texts, architecture)], architecture)
        try:
            built.write_bytes(content)
        except OSError as error:
            raise KernelUnavailable(f"cannot write a kernel to {folder}: {error.strerror}; {ELSEWHERE}") from error
        try:
            stored = own.store(key, built)
        except OSError as error:
            why = f"the kernel was not kept in {cache.folder} ({error.strerror}); it will be compiled again next time"
            return Image(built, version, cached=False, note=why)
        built.unlink()
        return Image(stored, version, cached=False)


def compiled(texts: Sequence[str], architecture: str, flags: Sequence[str] = ()) -> list[tuple[bytes, str]]:
    """Compile each text to an object and the compiler's log; KernelUnavailable with the first error."""
    nvrtc, _ = _libraries()
    options = [flag.encode() for flag in (f"--gpu-architecture={architecture}", *FLAGS, *flags)]
    with ThreadPoolExecutor(processors()) as pool:
        return list(pool.map(lambda text: _object(nvrtc, text, options), texts))


def linked(objects: Sequence[bytes], architecture: str) -> bytes:
    """Return one image of all objects."""
    _, nvjitlink = _libraries()
    handle = nvjitlink.create(1, [f"-arch={architecture}"])
    try:
        for number, part in enumerate(objects):
            nvjitlink.add_data(handle, nvjitlink.InputType.CUBIN, part, len(part), f"part{number}")
        nvjitlink.complete(handle)
        found = bytearray(nvjitlink.get_linked_cubin_size(handle))
        nvjitlink.get_linked_cubin(handle, found)
    except nvjitlink.nvJitLinkError as error:
        raise KernelUnavailable(f"the kernel for {architecture} cannot be linked: {error}") from error
    finally:
        nvjitlink.destroy(handle)
    return bytes(found)


def _object(nvrtc: Any, text: str, options: list[bytes]) -> tuple[bytes, str]:
    program = _checked(nvrtc, nvrtc.nvrtcCreateProgram(text.encode(), b"kernel.cu", 0, [], []))
    try:
        failed = nvrtc.nvrtcCompileProgram(program, len(options), options)[0] != nvrtc.nvrtcResult.NVRTC_SUCCESS
        said = bytearray(_checked(nvrtc, nvrtc.nvrtcGetProgramLogSize(program)))
        _checked(nvrtc, nvrtc.nvrtcGetProgramLog(program, said))
        log = said.decode(errors="replace").strip("\0\n ")
        if failed:
            raise KernelUnavailable(
                f"nvrtc refuses the kernel: {log.splitlines()[0] if log else 'it does not say why'}"
            )
        found = bytearray(_checked(nvrtc, nvrtc.nvrtcGetCUBINSize(program)))
        _checked(nvrtc, nvrtc.nvrtcGetCUBIN(program, found))
        return bytes(found), log
    finally:
        nvrtc.nvrtcDestroyProgram(program)


def _checked(nvrtc: Any, answer: tuple[Any, ...]) -> Any:
    """Return the results of a call without its status."""
    status, *values = answer
    if status != nvrtc.nvrtcResult.NVRTC_SUCCESS:
        raise KernelUnavailable(f"nvrtc: {status.name}")
    return values[0] if len(values) == 1 else values


def _libraries() -> tuple[Any, Any]:
    try:
        from cuda.bindings import nvjitlink, nvrtc

        nvrtc.nvrtcVersion(), nvjitlink.version()
    except (ImportError, RuntimeError) as error:
        raise KernelUnavailable(f"NVRTC and nvJitLink were not found: {ADVICE} ({error})") from error
    return nvrtc, nvjitlink


class Gpu:
    """A GPU by CuPy; implements ``Device``."""

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
            with self._cuda_errors():
                module = self.cupy.RawModule(path=str(found.path))
                module.get_function(FIRST)  # CuPy reads the file when it is asked for the first kernel
        return module, found.compiler, found.cached, found.note

    def free(self) -> int:
        """Implement ``Device.free``."""
        self.cupy.get_default_memory_pool().free_all_blocks()
        return max(0, int(self.cupy.cuda.runtime.memGetInfo()[0]) - RESERVED_BYTES)

    def put(self, values: NDArray[Any]) -> Any:
        """Implement ``Device.put``."""
        with self._cuda_errors():
            return self.cupy.asarray(np.ascontiguousarray(values))

    def empty(self, shape: tuple[int, ...], dtype: DTypeLike) -> Any:
        """Implement ``Device.empty``."""
        with self._cuda_errors():
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
        with self._cuda_errors():
            return np.asarray(self.cupy.asnumpy(array))

    def launch(self, module: Any, name: str, blocks: int, threads: tuple[int, int], job: Any) -> None:
        """Implement ``Device.launch``."""
        with self._cuda_errors():
            module.get_function(name)((blocks,), threads, (job,))

    def wait(self) -> None:
        """Implement ``Device.wait``."""
        with self._cuda_errors():
            self.cupy.cuda.get_current_stream().synchronize()

    @contextmanager
    def _cuda_errors(self) -> Iterator[None]:
        """Raise errors of CUDA as KernelUnavailable in one line."""
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
    """Return the GPU that CUDA names first; KernelUnavailable says what is missing."""
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
