"""The queue of the runs of a batch that are left."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Hashable, Mapping
from time import monotonic

from symphys.runs.job import Job

CLAIM_POLL_INTERVAL = 1.0
"""[s] between two checks of a run that another command has claimed."""


class Queue:
    """Waiting runs by their subject, and runs that other commands have claimed.

    A worker that has built a problem file gets more of its runs, points of a sweep too; other workers get those of a
    file that nobody works on. So one worker compiles a problem while the others do something else, if there is any.
    """

    def __init__(self, jobs: Mapping[int, Job]) -> None:
        """Start with all jobs waiting, in the order given."""
        self.jobs = jobs
        self.waiting: dict[Hashable, deque[int]] = {}
        self.claimed: dict[int, float] = {}
        self.subjects = {index: hash((job.problem.file, job.problem.text)) for index, job in jobs.items()}
        self.at_work: Counter[Hashable] = Counter()
        for index in jobs:
            self.put(index)

    def __len__(self) -> int:
        """Return how many runs are left that nobody here works on."""
        return sum(map(len, self.waiting.values())) + len(self.claimed)

    def put(self, index: int) -> None:
        """Put a run behind the others of its subject."""
        self.waiting.setdefault(self.subjects[index], deque()).append(index)

    def put_off(self, index: int) -> None:
        """Keep a run that another command has claimed, to look again whether it is over."""
        self.claimed[index] = monotonic() + CLAIM_POLL_INTERVAL

    def take(self, last: Hashable = None) -> int | None:
        """Return the next run for a worker whose last subject was ``last``; None if there is none for the moment."""
        now = monotonic()
        for index in [index for index, due in self.claimed.items() if due <= now]:
            del self.claimed[index]
            self.put(index)
        subject = self.choose(last)
        if subject is None:
            return None
        index = self.waiting[subject].popleft()
        if not self.waiting[subject]:
            del self.waiting[subject]
        self.at_work[subject] += 1
        return index

    def choose(self, last: Hashable) -> Hashable | None:
        """Return the subject of the next run."""
        if last in self.waiting:
            return last
        free = (subject for subject in self.waiting if not self.at_work[subject])
        return next(free, next(iter(self.waiting), None))

    def remove(self, index: int) -> None:
        """Take out a waiting run that is done."""
        subject = self.subjects[index]
        self.waiting[subject].remove(index)
        if not self.waiting[subject]:
            del self.waiting[subject]

    def done(self, index: int) -> Hashable:
        """Note that nobody works on a run any more, and return its subject."""
        subject = self.subjects[index]
        self.at_work[subject] -= 1
        return subject
