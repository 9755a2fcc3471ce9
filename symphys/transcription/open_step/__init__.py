"""One step of a problem whose commands are given from outside, as agents and nets of other libraries do."""

from symphys.transcription.open_step.compiled import CompiledStep, StepResult, StepStart, compile_open_step
from symphys.transcription.open_step.opening import ExternalControlProblem, opened

__all__ = ["CompiledStep", "ExternalControlProblem", "StepResult", "StepStart", "compile_open_step", "opened"]
