"""Problems written as text, and that a compiled kernel gives for them what casadi does."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from worlds.toys import require

from symphys.problem import load_problem
from symphys.transcription import Transcription, transcribe


@cache
def transcribed(text: str, backend: str) -> Transcription:
    """The problem for a backend in one thread; skips where that is not there."""
    require(backend)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "text.toml"
        file.write_text(text, encoding="utf-8")
        return transcribe(load_problem(file), backend=backend, threads=1)


def assert_kernel_gives_what_casadi_does(text: str, smoothing: float) -> None:
    """Merits and gradients from three seeds; every entry of the gradient counts."""
    Z = np.array([transcribed(text, "casadi").shooting.start(seed) for seed in range(3)])
    backends = ("casadi", "simd")
    exact, compiled = (transcribed(text, name).shooting.evaluator.gradient(Z, smoothing) for name in backends)
    assert exact.gradient is not None
    assert compiled.gradient is not None
    assert compiled.merit == pytest.approx(exact.merit, rel=1e-9)
    assert compiled.gradient == pytest.approx(exact.gradient, rel=1e-7, abs=1e-9 * np.abs(exact.gradient).max())
    assert np.abs(exact.gradient).min() > 0
