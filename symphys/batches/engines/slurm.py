"""Drivers as jobs of Slurm, submitted by submitit; or as processes of this machine that submitit starts alike."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import submitit

from symphys.batches.engines.driver import DriverTask, drive
from symphys.batches.engines.interface import EngineError
from symphys.interrupts import ignoring_interrupts
from symphys.suggest import hint

FOLDER = ".slurm"
"""In the folder of the batch: scripts and outputs of the jobs."""
LOCAL = "local"
ASKED: dict[str, Callable[[str], Any]] = {
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
"""What ``--scheduler`` may set, and of which type."""
SHARED = ("timeout_min", "mem_gb", "cpus_per_task")
"""Those that have the same name for all executors of submitit."""
DEFAULTS = {"timeout_min": 60, "cpus_per_task": 1}


def opened(scheduler: str, count: int, out: Path) -> SlurmEngine:
    """An engine for what is asked for: ``partition=short,timeout_min=60,mem_gb=4``, or ``local``."""
    here, asked = read_asked(scheduler)
    missing = next((name for name in ("sbatch", "srun") if shutil.which(name) is None), "")
    if missing and not here:
        raise EngineError(
            f"there is no {missing} on this machine: call symphys where Slurm takes jobs, or give --scheduler local"
        )
    executor = submitit.AutoExecutor(folder=str(out / FOLDER), cluster=LOCAL if here else "slurm")
    named = {name if name in SHARED else f"slurm_{name}": value for name, value in asked.items()}
    executor.update_parameters(name="symphys", **DEFAULTS | named)
    return SlurmEngine(executor)


def read_asked(scheduler: str) -> tuple[bool, dict[str, Any]]:
    """(whether to stay on this machine, what is asked for); EngineError for what cannot be."""
    words = [word.strip() for word in scheduler.split(",") if word.strip()]
    asked = {}
    for word in words:
        if word == LOCAL:
            continue
        key, equals, value = word.partition("=")
        if not equals or key not in ASKED:
            raise EngineError(f"--scheduler {word!r}: write local, or KEY=VALUE; {hint(key, ASKED)}")
        try:
            asked[key] = ASKED[key](value)
        except ValueError as error:
            raise EngineError(f"--scheduler {word!r}: {key} is a number") from error
    return LOCAL in words, asked


class SlurmEngine:
    """Drivers as jobs."""

    def __init__(self, executor: Any) -> None:
        """None is submitted."""
        self.executor = executor
        self.jobs: list[Any] = []
        self.heard: list[str] = []

    def start(self, task: DriverTask) -> None:
        """Submit one more."""
        try:
            with ignoring_interrupts():
                self.jobs.append(self.executor.submit(drive, task))
        except (submitit.core.utils.FailedJobError, OSError) as error:
            raise EngineError(f"Slurm does not take the job: {last_line(error)}") from error

    def alive(self) -> int:
        """Jobs that wait or run."""
        over = [job for job in self.jobs if job.done()]
        self.heard += filter(None, map(ended, over))
        self.jobs = [job for job in self.jobs if job not in over]
        return len(self.jobs)

    def faults(self) -> list[str]:
        """What ended jobs."""
        found, self.heard = self.heard, []
        return found

    def close(self) -> None:
        """Cancel what is left."""
        for job in self.jobs:
            job.cancel(check=False)


def ended(job: Any) -> str:
    """What ended a job, in a line; empty if it ended by itself."""
    if not job.paths.result_pickle.exists():  # submitit would wait for it
        return f"the job {job.job_id} was ended ({job.state}); see {job.paths.stderr}"
    error = job.exception()
    return "" if error is None else last_line(error)


def last_line(error: BaseException) -> str:
    """Of what submitit tells at length, the end, where the reason is."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else type(error).__name__
