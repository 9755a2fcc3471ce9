"""Samples of scenarios: numbers and poses that are drawn, behind z in the vector of a kernel."""

from symphys.transcription.randomization.transcription import with_scenarios

__all__ = ["with_scenarios"]
