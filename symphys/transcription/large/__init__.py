"""Rollouts with large nets: matrix products over the batch between compiled steps, weights shared by all robots."""

from symphys.transcription.large.evaluator import LargeEvaluator, Shared
from symphys.transcription.large.split import has_large_nets, require_small_nets
from symphys.transcription.large.transcription import LargeTranscription, transcribe_large

__all__ = ["LargeEvaluator", "LargeTranscription", "Shared", "has_large_nets", "require_small_nets", "transcribe_large"]
