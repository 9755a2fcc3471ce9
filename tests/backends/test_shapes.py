"""Boxes, capsules and terrain: a compiled kernel gives what casadi does, values and gradients."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from toys import require

from symphys.problem import load_problem
from symphys.transcription import Transcription, transcribe

YARD = """
[simulation]
duration = 0.12
dt = 0.01
sweeps = 2
cuts = 0

[[body]]
name = "crate"
shape = { box = { size = [0.4, 0.3, 0.2] } }
mass = 2.0
position = [0.3, 0, 0.11]

[[body]]
name = "rod"
shape = { capsule = { radius = 0.1, length = 0.4 } }
mass = 1.0
position = [0.3, 0.05, 0.46]
orientation = { pitch_deg = 80 }

[[terrain]]
name = "hills"
height = "0.03 * sin(3 * x) * cos(2 * y)"

[[block]]
name = "slab"
shape = { box = { size = [2, 2, 0.2] } }
position = [0.3, 0, -0.1]

[[pair]]
between = ["crate", "hills"]
collide = false

[[pair]]
between = ["crate", "rod"]
collide = false

[[variable]]
name = "throw"
sets = "rod.velocity"
guess = [0.3, 0.2, -4]
spread = 0.2

[[target]]
name = "place"
value = "rod.position + crate.position"
tolerance = 0.1
"""


@cache
def yard(backend: str) -> Transcription:
    require(backend)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "yard.toml"
        file.write_text(YARD, encoding="utf-8")
        return transcribe(load_problem(file), backend=backend, threads=1)


@pytest.mark.parametrize("smoothing", [0.0, 1e-3])
def test_a_kernel_gives_what_casadi_does(smoothing: float) -> None:
    Z = np.array([yard("casadi").shooting.start(seed) for seed in range(3)])
    exact, compiled = (yard(backend).shooting.evaluator.gradient(Z, smoothing) for backend in ("casadi", "simd"))
    assert exact.gradient is not None and compiled.gradient is not None
    assert compiled.merit == pytest.approx(exact.merit, rel=1e-9)
    assert compiled.gradient == pytest.approx(exact.gradient, rel=1e-7, abs=1e-9 * np.abs(exact.gradient).max())
    assert np.abs(exact.gradient).min() > 0
