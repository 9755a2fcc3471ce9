"""Transcriptions, made once for all runs of a problem."""

from __future__ import annotations

from collections.abc import Callable

from symphys.problem import Problem
from symphys.runs.job import Job
from symphys.transcription import Transcription, guessed

Transcribe = Callable[[Problem, bool], Transcription]
"""(problem, whether smoothing 0 is all that will be asked for) -> its transcription."""
Transcriptions = Callable[[Job], Transcription]
"""What has the transcription of a job's problem, such as a ``TranscriptionCache``."""


class TranscriptionCache:
    """Keeps the transcription of the problem that was last asked for; one problem's functions may be large."""

    def __init__(self, transcribe: Transcribe) -> None:
        """Start empty."""
        self.transcribe = transcribe
        self.made: tuple[object, Transcription] | None = None

    def __call__(self, job: Job) -> Transcription:
        """The job's problem as a shooting problem, with the job's guess."""
        if self.made is None or self.made[0] != job.subject:
            self.made = None
            self.made = (job.subject, self.transcribe(job.problem, not job.smooth))
        return guessed(self.made[1], job.problem) if job.guess.digest else self.made[1]
