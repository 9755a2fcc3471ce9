"""What the smoothing smoothing would change."""

from __future__ import annotations

from typing import Any

import numpy as np

from symphys.trajectory import NotFinite
from symphys.transcription import Record, Transcription

TRIED = (1e-3, 1e-2, 1e-1)
"""[m/s] tried where the problem itself is not smoothed."""


def smoothed(transcription: Transcription, record: Record) -> list[dict[str, Any]]:
    """How the exact motion of ``record`` does in smoothed rollouts.

    Returns:
        For each "smoothing" [m/s] of the problem's own stages, or of ``TRIED`` where it has none, the "objective" and
        the "worst" error / tolerance and "costs", the sum of what is minimised; "own" says which of the two it is.
        "moved": how far bodies get from their places in the exact motion, as a share of the longest way of one.
    """
    z = record.z
    own = [smoothing for smoothing in transcription.problem.simulation.smoothing if smoothing > 0]
    rows = []
    for smoothing in own or TRIED:
        verdict = transcription.judge(z, smoothing)
        found = {"objective": verdict.objective, "worst": verdict.worst, "costs": sum(verdict.costs.values())}
        moved = _moved(record, transcription, smoothing)
        rows.append({"smoothing": smoothing, "own": bool(own), **found, "moved": moved})
    return rows


def _moved(record: Record, transcription: Transcription, smoothing: float) -> float:
    """NaN where there is no such motion, or none without smoothing."""
    place = record.motion.position
    way = float(np.linalg.norm(place - place[0], axis=2).max(initial=0.0))
    try:
        other = transcription.simulate(record.z, smoothing).position
    except NotFinite:
        return float("nan")
    return float(np.linalg.norm(other - place, axis=2).max(initial=0.0)) / way if way else float("nan")
