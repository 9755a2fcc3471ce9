"""Multi-start: seeds of one problem and solver solved side by side, their evaluations in batches."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Mapping

from symphys.runs.job import Job
from symphys.runs.transcription_cache import TranscriptionCache
from symphys.solvers import Monitor, Outcome, TraceRow, solve_multi_start, solver


def groups(jobs: Mapping[int, Job], halfway: Collection[int]) -> list[list[int]]:
    """The indices of the jobs in their order, those together that differ in their seed only and begin afresh."""
    found: list[list[int]] = []
    for index, job in jobs.items():
        if found and index not in halfway and alike(jobs[found[-1][-1]], job) and found[-1][-1] not in halfway:
            found[-1].append(index)
        else:
            found.append([index])
    return found


def alike(one: Job, other: Job) -> bool:
    """Whether two jobs are of one problem, one solver that runs in threads, and the same options."""
    same = one.problem is other.problem and one.config.solver == other.config.solver and one.options == other.options
    return same and solver(one.config.solver).threaded


def solve_group(
    jobs: Mapping[int, Job], transcriptions: TranscriptionCache, watch: Callable[[int], Monitor]
) -> dict[int, Outcome]:
    """The outcomes of a group, each as if solved alone; none where something fails: each then has to show by itself."""
    first = next(iter(jobs.values()))
    lock = threading.Lock()

    def monitored(index: int) -> Monitor:
        report = watch(index)

        def monitor(row: TraceRow) -> None:
            with lock:
                report(row)

        return monitor

    seeds = [job.config.seed for job in jobs.values()]
    try:
        shooting = transcriptions(first).shooting
        starts = [shooting.start(seed) for seed in seeds]
        monitors = [monitored(index) for index in jobs]
        chosen = solver(first.config.solver)
        found = solve_multi_start(chosen, shooting, starts, first.options, seeds, monitors)
    except Exception:  # the run that it belongs to reports it when it is solved alone
        return {}
    return dict(zip(jobs, found, strict=True))
