"""What the smoothing knob would change."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.transcription import Transcription

KNOBS = (1e-3, 1e-2, 1e-1)
"""[m/s] tried where the problem itself is not smoothed."""


def smoothed(transcription: Transcription, z: NDArray[np.float64]) -> list[dict[str, Any]]:
    """How ``z`` does in smoothed rollouts.

    Returns:
        For each "smoothing" [m/s] of the problem's own stages, or of ``KNOBS`` where it has none, the "objective" and
        the "worst" error / tolerance; "own" says which of the two it is.
    """
    own = [knob for knob in transcription.problem.simulation.smoothing if knob > 0]
    rows = []
    for knob in own or KNOBS:
        verdict = transcription.judge(z, knob)
        rows.append({"smoothing": knob, "own": bool(own), "objective": verdict.objective, "worst": verdict.worst})
    return rows
