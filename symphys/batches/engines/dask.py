"""Drivers as tasks of dask: on a cluster of this machine, or on one that runs already."""

from __future__ import annotations

import contextlib
import logging
from pathlib import Path
from time import monotonic
from typing import Any

import dask
from distributed import Client, LocalCluster

from symphys.batches.engines import EngineError
from symphys.batches.engines.driver import DriverTask, drive
from symphys.interrupts import ignoring_interrupts

TIMEOUT = 15
"""[s] after which a scheduler that does not answer is given up, and a driver without an idle worker is queued."""
CONFIG = {
    "distributed.admin.large-graph-warning-threshold": "1 TiB",  # all jobs of a batch go to each driver, once
    "distributed.scheduler.allowed-failures": 0,  # a driver whose worker dies is started again from here
    "distributed.scheduler.worker-ttl": None,  # casadi holds the interpreter for minutes while it builds
    "distributed.worker.profile.enabled": False,  # nobody reads the profile of a driver
    "distributed.worker.daemon": False,  # runs with a timeout have processes of their own
}


def opened(scheduler: str, count: int, out: Path) -> DaskEngine:
    """Connect to the cluster at an address such as ``tcp://host:8786``; without one, start ``count`` workers here."""
    return DaskEngine(scheduler, count)


class DaskEngine:
    """Drivers as tasks on a dask cluster."""

    def __init__(self, scheduler: str, count: int) -> None:
        """Connect, and start workers if there is no scheduler; EngineError if it does not answer."""
        self.waiting: list[tuple[float, DriverTask]] = []
        self.futures: dict[Any, str] = {}
        with contextlib.ExitStack() as stack:
            stack.enter_context(dask.config.set(CONFIG))
            where = scheduler or stack.enter_context(local(count))
            try:
                self.client = stack.enter_context(Client(where, timeout=TIMEOUT, set_as_default=False))
            except (OSError, ValueError) as error:
                raise EngineError(
                    f"no dask scheduler answers at {scheduler}: give the address that it shows when it starts, "
                    "such as tcp://host:8786"
                ) from error
            self.stack = stack.pop_all()

    def start(self, task: DriverTask) -> None:
        """Submit one more driver, once a worker is idle: dask itself would queue it behind another driver."""
        self.waiting.append((monotonic(), task))
        self.place()

    def place(self) -> None:
        """Give waiting drivers to idle workers; after TIMEOUT, let dask find or start some."""
        if not self.waiting:
            return
        taken = set(self.futures.values())
        idle = [address for address, keys in self.client.processing().items() if not keys and address not in taken]
        left = []
        for since, task in self.waiting:
            if idle:
                address = idle.pop()
                where = {"workers": [address], "allow_other_workers": True}
                self.futures[self.client.submit(drive, task, pure=False, **where)] = address
            elif monotonic() - since > TIMEOUT:
                self.futures[self.client.submit(drive, task, pure=False)] = ""
            else:
                left.append((since, task))
        self.waiting = left

    def poll(self) -> tuple[int, list[str]]:
        """Return how many tasks wait or work, and why others ended since the last call."""
        over = [future for future in self.futures if future.status != "pending"]
        faults = [cause_of(future) for future in over if future.status != "finished"]
        for future in over:
            del self.futures[future]
        self.place()
        return len(self.futures) + len(self.waiting), faults

    def close(self) -> None:
        """Cancel the tasks, and end the cluster if it was started here."""
        self.client.cancel(list(self.futures))
        self.stack.close()


@contextlib.contextmanager
def local(count: int) -> Any:
    """Start workers on this machine, with one thread each; a worker that dies is restarted."""
    with ignoring_interrupts():
        cluster = LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            dashboard_address=None,
            memory_limit=0,
            silence_logs=logging.CRITICAL,  # the command itself reports workers that die
        )
    with cluster:
        yield cluster


def cause_of(future: Any) -> str:
    """Return why a task ended, in a line."""
    if future.status != "error":
        return f"its dask task is {future.status}"
    error = future.exception()
    if type(error).__name__ == "KilledWorker":
        return "its dask worker died"
    return f"{error}".strip().partition("\n")[0] or type(error).__name__
