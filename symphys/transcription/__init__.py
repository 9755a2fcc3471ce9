"""From a problem to a shooting problem: the rollout, its costs and their derivatives as casadi functions."""

from symphys.transcription.judge import Check, Verdict
from symphys.transcription.program import rollout_program
from symphys.transcription.transcribe import Judge, Transcription, judge_for, transcribe

__all__ = ["Check", "Judge", "Transcription", "Verdict", "judge_for", "rollout_program", "transcribe"]
