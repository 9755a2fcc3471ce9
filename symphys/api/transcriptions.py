"""Transcriptions of problems, cached: the next call for the same problem compiles nothing."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from symphys.problem import Problem
from symphys.transcription import Transcription, transcribe

if TYPE_CHECKING:
    from symphys.transcription.open_step import CompiledStep
    from symphys.transcription.recorded_rollout import RecordedRollout
    from symphys.transcription.staged.linearization import Linearization

CACHE_SIZE = 8
"""Size of each cache: the kernels of one problem may take hundreds of megabytes."""


@lru_cache(maxsize=CACHE_SIZE)
def transcribed(problem: Problem, exact: bool, backend: str, threads: int | None = None) -> Transcription:
    """Transcribe a problem, as ``symphys.transcription.transcribe`` does."""
    return transcribe(problem, exact, backend, threads)


@lru_cache(maxsize=CACHE_SIZE)
def linearized(problem: Problem, exact: bool, backend: str, threads: int | None = None) -> Linearization:
    """Compile the Jacobians of the steps of a problem."""
    from symphys.transcription.staged.linearization import Linearization

    return Linearization(transcribed(problem, exact, backend, threads).rollout, backend, threads, exact)


@lru_cache(maxsize=CACHE_SIZE)
def stepped(
    problem: Problem,
    controllers: tuple[str, ...] | None,
    sensors: tuple[str, ...] | None,
    smoothing: float,
    backend: str,
    threads: int | None,
) -> CompiledStep:
    """Compile a step with open commands, as ``compile_step`` does."""
    from symphys.transcription.open_step import compile_open_step

    return compile_open_step(problem, controllers, sensors, smoothing, backend, threads)


@lru_cache(maxsize=CACHE_SIZE)
def recorded(
    problem: Problem, quantities: tuple[str, ...], smoothing: float, backend: str, threads: int | None = None
) -> RecordedRollout:
    """Compile a rollout with quantities over time as outputs."""
    from symphys.transcription.recorded_rollout import record_rollout

    return record_rollout(problem, quantities, smoothing, backend, threads)
