"""From a problem to a shooting problem: the rollout, its costs and their derivatives as casadi functions."""

from symphys.transcription.gradient_probe import Probe
from symphys.transcription.judge import Check, Verdict
from symphys.transcription.nan_tracing.steps import first_derivative_fault, first_fault
from symphys.transcription.objective import Terms, terms
from symphys.transcription.program import rollout_program
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.transcription.simulation import Record, plain
from symphys.transcription.transcribe import transcribe
from symphys.transcription.transcription import Transcription

__all__ = [
    "Check",
    "Probe",
    "Record",
    "Rollout",
    "Terms",
    "Transcription",
    "Verdict",
    "first_derivative_fault",
    "first_fault",
    "plain",
    "rollout_program",
    "symbolic_rollout",
    "terms",
    "transcribe",
]
