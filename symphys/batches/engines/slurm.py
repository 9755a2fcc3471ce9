"""Drivers as jobs of Slurm, submitted by submitit; or as processes of this machine that submitit starts alike."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import submitit

from symphys.batches.engines import EngineError
from symphys.batches.engines.driver import DriverTask, drive
from symphys.interrupts import ignoring_interrupts
from symphys.suggest import hint

FOLDER = ".slurm"
"""Folder for scripts and outputs of the jobs, inside the folder of the batch."""
LOCAL = "local"
REQUEST_TYPES: dict[str, Callable[[str], Any]] = {
    "timeout_min": int,
    "mem_gb": float,
    "cpus_per_task": int,
    "partition": str,
    "account": str,
    "qos": str,
    "constraint": str,
    "exclude": str,
    "gres": str,
}
"""The keys of ``--scheduler``, with their types."""
SHARED_KEYS = ("timeout_min", "mem_gb", "cpus_per_task")
"""Keys with the same name for all executors of submitit."""
REQUEST_DEFAULTS = {"timeout_min": 60, "cpus_per_task": 1}


def opened(scheduler: str, count: int, out: Path) -> SlurmEngine:
    """Make an engine for a request such as ``partition=short,timeout_min=60,mem_gb=4``, or ``local``."""
    here, asked = read_request(scheduler)
    missing = next((name for name in ("sbatch", "srun") if shutil.which(name) is None), "")
    if missing and not here:
        raise EngineError(
            f"there is no {missing} on this machine: call symphys where Slurm takes jobs, or give --scheduler local"
        )
    executor = submitit.AutoExecutor(folder=str(out / FOLDER), cluster=LOCAL if here else "slurm")
    named = {name if name in SHARED_KEYS else f"slurm_{name}": value for name, value in asked.items()}
    executor.update_parameters(name="symphys", **REQUEST_DEFAULTS | named)
    return SlurmEngine(executor)


def read_request(scheduler: str) -> tuple[bool, dict[str, Any]]:
    """Return (whether to stay on this machine, the request by key); EngineError for a request that is not valid."""
    words = [word.strip() for word in scheduler.split(",") if word.strip()]
    asked = {}
    for word in words:
        if word == LOCAL:
            continue
        key, equals, value = word.partition("=")
        if not equals or key not in REQUEST_TYPES:
            raise EngineError(f"--scheduler {word!r}: write local, or KEY=VALUE; {hint(key, REQUEST_TYPES)}")
        try:
            asked[key] = REQUEST_TYPES[key](value)
        except ValueError as error:
            raise EngineError(f"--scheduler {word!r}: {key} is a number") from error
    return LOCAL in words, asked


class SlurmEngine:
    """Drivers as jobs of Slurm."""

    def __init__(self, executor: Any) -> None:
        """Start without jobs."""
        self.executor = executor
        self.jobs: list[Any] = []

    def start(self, task: DriverTask) -> None:
        """Submit one more job."""
        try:
            with ignoring_interrupts():
                self.jobs.append(self.executor.submit(drive, task))
        except (submitit.core.utils.FailedJobError, OSError) as error:
            raise EngineError(f"Slurm does not take the job: {last_line(error)}") from error

    def poll(self) -> tuple[int, list[str]]:
        """Return how many jobs wait or run, and why others ended since the last call."""
        over = [job for job in self.jobs if job.done()]
        self.jobs = [job for job in self.jobs if job not in over]
        return len(self.jobs), list(filter(None, map(cause_of, over)))

    def close(self) -> None:
        """Cancel the jobs that are left."""
        for job in self.jobs:
            job.cancel(check=False)


def cause_of(job: Any) -> str:
    """Return why a job ended, in a line; empty if it ended by itself."""
    if not job.paths.result_pickle.exists():  # submitit would wait for it
        return f"the job {job.job_id} was ended ({job.state}); see {job.paths.stderr}"
    error = job.exception()
    return "" if error is None else last_line(error)


def last_line(error: BaseException) -> str:
    """Return the last line of a long message of submitit, which has the reason."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else type(error).__name__
