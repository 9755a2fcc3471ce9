"""The runs of a batch that are left, and which of them is next."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Hashable, Mapping
from time import monotonic

from symphys.runs.job import Job

LOOK = 1.0
"""[s] between two looks at a run that another command has claimed."""


class Queue:
    """Runs that wait, by what they are of, and runs that other commands have claimed.

    Whoever has built a problem file gets more of its runs, points of a sweep too; who has not, those of a file that
    nobody is at. So a problem is built and compiled by one while the others do something else, as long as there is
    something else.
    """

    def __init__(self, jobs: Mapping[int, Job]) -> None:
        """All wait, in the order that is given."""
        self.jobs = jobs
        self.waiting: dict[Hashable, deque[int]] = {}
        self.claimed: dict[int, float] = {}
        self.subjects = {index: hash((job.problem.file, job.problem.text)) for index, job in jobs.items()}
        self.at_work: Counter[Hashable] = Counter()
        for index in jobs:
            self.put(index)

    def __len__(self) -> int:
        """How many are left that nobody here works on."""
        return sum(map(len, self.waiting.values())) + len(self.claimed)

    def put(self, index: int) -> None:
        """Let a run wait behind the others of its kind."""
        self.waiting.setdefault(self.subjects[index], deque()).append(index)

    def put_off(self, index: int) -> None:
        """Another command has claimed it: look again in a while whether it is over."""
        self.claimed[index] = monotonic() + LOOK

    def take(self, last: Hashable = None) -> int | None:
        """The next run for whoever did one of the subject ``last``; None if there is none for now."""
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
        """The subject of which the next run is."""
        if last in self.waiting:
            return last
        free = (subject for subject in self.waiting if not self.at_work[subject])
        return next(free, next(iter(self.waiting), None))

    def remove(self, index: int) -> None:
        """It is done."""
        subject = self.subjects[index]
        self.waiting[subject].remove(index)
        if not self.waiting[subject]:
            del self.waiting[subject]

    def done(self, index: int) -> Hashable:
        """Nobody works on it any more; its subject."""
        subject = self.subjects[index]
        self.at_work[subject] -= 1
        return subject
