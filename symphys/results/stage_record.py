"""A stage of smoothing, as a frozen record; ``nan`` is a number that is not known."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Stage:
    """What a stage came to.

    Attributes:
        smoothing: the knob [m/s].
        status: how it ended.
        objective, worst: of its best point at this smoothing; ``worst`` is the largest error / tolerance.
        exact_objective, exact_worst, solved: the same point in the exact rollout.
        counts: evaluations by kind, those of the stages before it left out.
        equivalents: this work in rollouts.
        seconds: wall time, likewise.
    """

    smoothing: float
    status: str
    objective: float
    worst: float
    exact_objective: float
    exact_worst: float
    solved: bool
    counts: Mapping[str, float]
    equivalents: float
    seconds: float


def smoothed(stages: Iterable[Stage]) -> bool:
    """Whether the solver saw anything but exact contact."""
    return any(stage.smoothing > 0 for stage in stages)
