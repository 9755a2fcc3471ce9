"""``--backend cuda``: the processor and a clear word without a GPU, the GPU's numbers with one."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from fakes.emulated import Emulated, needs_compiler
from worlds.toys import require

from symphys.codegen import KernelUnavailable
from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import Transcription, transcribe

SETTINGS = {"simulation.duration": 1.0}


def throw(backend: str) -> Transcription:
    return transcribe(load_problem(find("ball_throw"), SETTINGS), backend=backend, threads=1)


@pytest.mark.parametrize("backend, instead", [("cuda", "simd"), ("cuda32", "simd32")])
def test_without_a_gpu_the_processor_evaluates_and_says_so(
    backend: str, instead: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    require(instead)
    monkeypatch.setitem(sys.modules, "cupy", None)
    told = throw(backend).backend
    assert told.name == instead
    assert (
        told.note
        == "the processor evaluates: no CuPy to reach a GPU with: pip install '.[cuda]' in a checkout of symphys"
    )


def test_a_broken_driver_is_told_in_its_own_words(monkeypatch: pytest.MonkeyPatch) -> None:
    require("simd")

    def refuse() -> None:
        raise KernelUnavailable("no GPU that CUDA can use: cudaErrorInsufficientDriver")

    monkeypatch.setattr("symphys.codegen.cuda.find_gpu", refuse)
    assert throw("cuda").backend.note.endswith("cudaErrorInsufficientDriver")


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("kind", ["value", "gradient", "residuals", "jacobian"])
def test_every_evaluation_is_the_processors(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    require("simd")
    monkeypatch.setattr("symphys.codegen.cuda.find_gpu", lambda: Emulated(tmp_path))
    there, here = throw("cuda"), throw("simd")
    assert (there.backend.name, there.backend.lanes, there.backend.note) == ("cuda", 4, "")
    Z = np.array([here.shooting.start(seed) for seed in range(5)])
    found, wanted = (getattr(made.shooting.evaluator, kind)(Z, 1e-3) for made in (there, here))
    for name in ("merit", "objective", "errors", "gradient", "residuals", "jacobian"):
        a, b = getattr(wanted, name), getattr(found, name)
        assert (a is None) == (b is None)
        if a is not None:
            np.testing.assert_allclose(b, a, rtol=1e-9, atol=1e-11 * (1 + np.abs(a).max()))
