"""What the guess was worth and each stage of smoothing came to, exactly and as the solver saw it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from symphys.results.result import StageRecord
from symphys.runs.cost import equivalents
from symphys.runs.folder import TOLD
from symphys.solvers import Outcome, StageResult
from symphys.transcription import Transcription


def guess_record(transcription: Transcription, seed: int) -> dict[str, float]:
    """What the start of a seed is worth exactly."""
    exact = transcription.judge(transcription.shooting.start(seed))
    return {
        "objective": exact.objective,
        "worst": exact.worst,
        **{TOLD + name: value for name, value in exact.outputs.items()},
    }


def stage_records(transcription: Transcription, outcome: Outcome, price: Mapping[str, float]) -> list[StageRecord]:
    """The stages of a solve; the point of each is judged by the exact rollout, which is no part of its time."""
    return [stage_record(transcription, stage, price) for stage in outcome.stages]


def stage_record(transcription: Transcription, stage: StageResult, price: Mapping[str, float]) -> StageRecord:
    """One stage as JSON."""
    exact = transcription.judge(stage.z)
    return StageRecord(
        smoothing=stage.smoothing,
        status=stage.status.value,
        objective=stage.objective,
        worst=stage.max_violation,
        exact_objective=exact.objective,
        exact_worst=exact.worst,
        solved=exact.solved,
        counts=asdict(stage.counts),
        equivalents=equivalents(stage.counts, price),
        seconds=stage.seconds,
    )
