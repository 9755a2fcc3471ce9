"""Problems made ready to compute, kept for the next call."""

from __future__ import annotations

from functools import lru_cache

from symphys.problem import Problem
from symphys.transcription import Transcription, transcribe

KEPT = 8
"""How many are kept: the kernels of one problem may take hundreds of megabytes."""


@lru_cache(maxsize=KEPT)
def transcribed(problem: Problem, exact: bool, backend: str, threads: int | None = None) -> Transcription:
    """See ``transcribe``; the same object for the same problem."""
    return transcribe(problem, exact, backend, threads)
