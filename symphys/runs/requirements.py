"""What a run needs of the machine: refused before anything is built, and named as what it is."""

from __future__ import annotations

from symphys.codegen.backends import PRECISIONS, require_kernels
from symphys.errors import SymphysError, Unavailable
from symphys.runs.job import Job
from symphys.runs.transcription_cache import Transcriptions
from symphys.solvers import solver
from symphys.transcription import Transcription

SAMPLES = "samples of [[scenario]] tables are evaluated by compiled kernels, and none can be made here"


def transcribed(job: Job, transcriptions: Transcriptions) -> Transcription:
    """The job's problem, transcribed.

    Raises:
        Unavailable: the machine lacks what the job's solver needs. What can be known before anything is built is.
        SymphysError: the job's backend cannot evaluate what its solver draws.
    """
    if not draws_samples(job):
        return transcriptions(job)
    require_samples(job)
    found = transcriptions(job)
    if found.shooting.scenario is None:
        raise Unavailable(found.backend.note)
    return found


def draws_samples(job: Job) -> bool:
    """Whether the job's solver draws samples of the problem's scenarios.

    One that is for all problems does without where its backend has no samples.
    """
    wants = solver(job.config.solver).scenarios
    return job.problem.scenarios is not None and (wants is True or (wants is None and job.config.backend in PRECISIONS))


def require_samples(job: Job) -> None:
    """Raise what ``transcribed`` says, from what is known without building anything."""
    backend = job.config.backend
    if backend not in PRECISIONS:
        raise SymphysError(
            f"the solver {job.config.solver} draws samples of [[scenario]] tables, which the backend {backend} cannot "
            f"evaluate: use {', '.join(list(PRECISIONS)[:-1])} or {list(PRECISIONS)[-1]}"
        )
    try:
        require_kernels(backend)
    except Unavailable as error:
        raise Unavailable(f"{SAMPLES}: {error}") from error
