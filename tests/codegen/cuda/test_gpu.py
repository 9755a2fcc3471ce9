"""What CuPy says of a GPU, and of none, by a stand-in for CuPy."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from symphys.codegen import Cache, KernelUnavailable
from symphys.codegen.cuda import find_gpu
from symphys.codegen.cuda.gpu import Gpu, Image


class Refusal(RuntimeError):
    """CUDA's."""


class Full(MemoryError):
    """CuPy's."""


def cupy(count: int = 1, **own: Any) -> Any:
    """A machine with so many GPUs, of which CuPy says what it says of an H200."""
    properties = {"name": b"NVIDIA H200", "warpSize": 32, "major": 9, "minor": 0}
    runtime = SimpleNamespace(
        CUDARuntimeError=Refusal,
        getDeviceCount=lambda: count,
        getDevice=lambda: 0,
        getDeviceProperties=lambda number: properties,
        memGetInfo=lambda: (2**30, 2**33),
    )
    cuda = SimpleNamespace(
        runtime=runtime,
        memory=SimpleNamespace(OutOfMemoryError=Full),
        driver=SimpleNamespace(CUDADriverError=type("CUDADriverError", (RuntimeError,), {})),
        compiler=SimpleNamespace(CompileException=type("CompileException", (Exception,), {})),
        get_current_stream=lambda: SimpleNamespace(synchronize=lambda: None),
    )
    pool = SimpleNamespace(free_all_blocks=lambda: None)
    module = {"cuda": cuda, "empty": np.empty, "asarray": np.array, "asnumpy": np.array}
    return SimpleNamespace(**{**module, "get_default_memory_pool": lambda: pool, **own})


def test_a_gpu_is_described(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "cupy", cupy())
    gpu = find_gpu(Cache(tmp_path))
    assert (gpu.name, gpu.lanes, gpu.architecture) == ("NVIDIA H200", 32, "sm_90")
    assert gpu.free() == 2**30 - 2**28
    assert np.array_equal(gpu.get(gpu.put(np.arange(6.0)[::2])), [0, 2, 4])


def test_a_machine_without_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cupy", cupy(count=0))
    with pytest.raises(KernelUnavailable, match="no GPU that CUDA can use"):
        find_gpu()


def test_a_driver_that_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> int:
        raise Refusal("cudaErrorInsufficientDriver")

    broken = cupy()
    broken.cuda.runtime.getDeviceCount = refuse
    monkeypatch.setitem(sys.modules, "cupy", broken)
    with pytest.raises(KernelUnavailable, match="cudaErrorInsufficientDriver"):
        find_gpu()


@pytest.mark.parametrize("error", [Full("Out of memory\n allocating"), Refusal("an illegal memory access")])
def test_what_cuda_refuses_is_told_in_a_line(error: Exception, tmp_path: Path) -> None:
    def fail(*given: object) -> None:
        raise error

    gpu = Gpu(cupy(empty=fail), Cache(tmp_path))
    with pytest.raises(KernelUnavailable, match=r"^NVIDIA H200 failed: [^\n]*$"):
        gpu.empty((3,), float)


class Alone:
    """An array that wants a library to be multiplied."""

    def __array_ufunc__(self, *given: object, **named: object) -> None:
        raise ImportError("libcublas.so.12: cannot open shared object file:\n No such file or directory")


def test_a_library_that_is_missing_is_told_in_a_line(tmp_path: Path) -> None:
    """As CuPy 14 says it where NVIDIA's driver is installed and CUDA is not."""
    said = Gpu(cupy(asarray=lambda values: Alone()), Cache(tmp_path)).lacks()
    assert "libcublas.so.12: cannot open" in said and "pip install '.[cuda]'" in said and "\n" not in said
    assert Gpu(cupy(), Cache(tmp_path)).lacks() == ""


def test_a_fault_of_ours_is_not_cudas(tmp_path: Path) -> None:
    gpu = Gpu(cupy(), Cache(tmp_path))
    with pytest.raises(TypeError):
        gpu.empty(("three",), float)  # type: ignore[arg-type]


def test_an_image_that_no_cache_takes_is_read_before_its_folder_goes(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    read = []

    class Module:
        """CuPy's, which opens its file late."""

        def __init__(self, path: str) -> None:
            self.path = Path(path)

        def get_function(self, name: str) -> None:
            read.append((name, self.path.read_bytes()))

    def built(texts: object, architecture: str, cache: Cache, folder: Path) -> Image:
        (folder / "image").write_bytes(b"of a kernel")
        return Image(folder / "image", "nvrtc 12.9", cached=False, note="not kept")

    monkeypatch.setattr("symphys.codegen.cuda.gpu.image", built)
    module, *told = Gpu(cupy(RawModule=Module), Cache(tmp_path)).load([])
    assert (read, told) == ([("begin", b"of a kernel")], ["nvrtc 12.9", False, "not kept"])
    assert not module.path.parent.exists()
