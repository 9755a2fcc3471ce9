"""Rollouts with large nets: matrix products over the batch between compiled steps, weights shared by all robots."""

from typing import TYPE_CHECKING

from symphys.later import later

if TYPE_CHECKING:
    from symphys.transcription.network_rollout.evaluator import LargeEvaluator, Shared
    from symphys.transcription.network_rollout.partition import fits_step, has_large_nets, require_small_nets
    from symphys.transcription.network_rollout.transcription import LargeTranscription

__all__ = [
    "LargeEvaluator",
    "LargeTranscription",
    "Shared",
    "fits_step",
    "has_large_nets",
    "require_small_nets",
]

__getattr__ = later(
    __name__,
    {
        "evaluator": ("LargeEvaluator", "Shared"),
        "partition": ("fits_step", "has_large_nets", "require_small_nets"),
        "transcription": ("LargeTranscription",),
    },
)
