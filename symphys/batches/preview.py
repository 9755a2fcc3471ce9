"""What a batch would do, and why, run by run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from symphys.runs.claim import owner
from symphys.runs.job import Job
from symphys.runs.standing import RERUN, standing


@dataclass(frozen=True)
class Preview:
    """A run before it is begun.

    Attributes:
        job: the run.
        todo: whether it would be done.
        stands: how it stands, in a word: a value of ``symphys.runs.standing.Stands``, or "claimed".
        why: in a clause.
    """

    job: Job
    todo: bool
    stands: str
    why: str


def previews(jobs: Sequence[Job], rerun: str = "") -> Iterator[Preview]:
    """How the runs stand, in their order; nothing is written. ``rerun``: as in ``run_batch``."""
    for job in jobs:
        found = standing(job)
        holder = owner(job.folder.path)
        todo = found.missing(RERUN.get(rerun, frozenset()))
        if holder is not None:
            yield Preview(job, False, "claimed", f"{holder} is at it")
        else:
            yield Preview(job, todo, found.stands.value, found.why)
