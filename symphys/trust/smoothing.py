"""What the smoothing knob would change."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.transcription import Transcription

KNOBS = (1e-3, 1e-2, 1e-1)
"""[m/s] tried where the problem itself is not smoothed."""


def smoothed(transcription: Transcription, z: NDArray[np.float64]) -> list[dict[str, Any]]:
    """"objective" and "worst" error / tolerance of ``z`` at the problem's "smoothing" [m/s], or at ``KNOBS``.

    "own" says whether the problem's solvers use this smoothing.
    """
    own = transcription.problem.simulation.smoothing
    rows = []
    for knob in (own,) if own > 0 else KNOBS:
        verdict = transcription.judge(z, knob)
        rows.append({"smoothing": knob, "own": own > 0, "objective": verdict.objective, "worst": verdict.worst})
    return rows
