"""Problems made ready to compute, kept for the next call."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from symphys.problem import Problem
from symphys.transcription import Transcription, transcribe

if TYPE_CHECKING:
    from symphys.transcription.open_step import CompiledStep
    from symphys.transcription.recorded_rollout import RecordedRollout
    from symphys.transcription.staged.linearization import Linearization

KEPT = 8
"""How many are kept: the kernels of one problem may take hundreds of megabytes."""


@lru_cache(maxsize=KEPT)
def transcribed(problem: Problem, exact: bool, backend: str, threads: int | None = None) -> Transcription:
    """See ``transcribe``; the same object for the same problem."""
    return transcribe(problem, exact, backend, threads)


@lru_cache(maxsize=KEPT)
def linearized(problem: Problem, exact: bool, backend: str, threads: int | None = None) -> Linearization:
    """See ``Linearization``; the same object for the same problem."""
    from symphys.transcription.staged.linearization import Linearization

    return Linearization(transcribed(problem, exact, backend, threads).rollout, backend, threads, exact)


@lru_cache(maxsize=KEPT)
def stepped(
    problem: Problem,
    controllers: tuple[str, ...] | None,
    sensors: tuple[str, ...] | None,
    smoothing: float,
    backend: str,
    threads: int | None,
) -> CompiledStep:
    """See ``compile_step``; the same object for the same problem."""
    from symphys.transcription.open_step import compile_open_step

    return compile_open_step(problem, controllers, sensors, smoothing, backend, threads)


@lru_cache(maxsize=KEPT)
def recorded(
    problem: Problem, quantities: tuple[str, ...], smoothing: float, backend: str, threads: int | None = None
) -> RecordedRollout:
    """See ``record_rollout``; the same object for the same problem."""
    from symphys.transcription.recorded_rollout import record_rollout

    return record_rollout(problem, quantities, smoothing, backend, threads)
