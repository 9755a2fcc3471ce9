"""From a problem to a shooting problem: the rollout, its objective and their derivatives as casadi functions."""

from typing import TYPE_CHECKING

from symphys.later import later
from symphys.transcription.gradient_probe import Probe
from symphys.transcription.judge import Assessment, Criterion
from symphys.transcription.objective import Terms, terms
from symphys.transcription.program import rollout_program
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.transcription.transcribe import guessed, transcribe, transcribe_finer
from symphys.transcription.transcription import Transcription

if TYPE_CHECKING:
    from symphys.transcription.nan_tracing import first_non_finite, first_non_finite_derivative
    from symphys.transcription.simulation import Record, plain

__all__ = [
    "Assessment",
    "Criterion",
    "Probe",
    "Record",
    "Rollout",
    "Terms",
    "Transcription",
    "first_non_finite",
    "first_non_finite_derivative",
    "guessed",
    "plain",
    "rollout_program",
    "symbolic_rollout",
    "terms",
    "transcribe",
    "transcribe_finer",
]

__getattr__ = later(
    __name__,
    {
        "nan_tracing": ("first_non_finite", "first_non_finite_derivative"),
        "simulation": ("Record", "plain"),
    },
)
