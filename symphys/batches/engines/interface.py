"""What an engine is: it starts drivers, processes on any machines that do the runs of one batch, and ends them.

An engine computes nothing and decides nothing. What is done stands in the run folders; who does it, in their claims.
"""

from __future__ import annotations

from typing import Protocol

from symphys.batches.engines.driver import DriverTask
from symphys.errors import SymphysError


class EngineError(SymphysError):
    """An engine that cannot be used; says what it needs."""


class Engine(Protocol):
    """Starts drivers and ends them. A new engine is one module with such a class and a function ``opened``."""

    def start(self, task: DriverTask) -> None:
        """Start one more driver: ``drive(task)`` in a process of its own, at once or when there is a place for it.

        EngineError if it cannot.
        """

    def alive(self) -> int:
        """How many drivers wait for a place or work."""

    def faults(self) -> list[str]:
        """What ended the drivers that did not end by themselves, in a line each; those since it was last asked."""

    def close(self) -> None:
        """End all drivers that are left, and whatever was started for them."""
