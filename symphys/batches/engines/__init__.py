"""Engines, which start the drivers of a batch elsewhere, by name; each is a module, imported when it is first used.

An engine computes nothing and decides nothing: run folders hold what is done, and claims say who is doing it.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from symphys.batches.engines.driver import DriverTask
from symphys.errors import SymphysError, install_advice
from symphys.suggest import hint

__all__ = ["ENGINES", "Engine", "EngineError", "open_engine"]

ENGINES = {"dask": ("dask", "distributed"), "slurm": ("submitit",)}
"""The packages that each engine needs; the extra has the engine's name."""


class EngineError(SymphysError):
    """Raised where an engine cannot be used; says what it needs."""


class Engine(Protocol):
    """Starter of drivers. A new engine is a module with such a class and a function ``opened``."""

    def start(self, task: DriverTask) -> None:
        """Start one more driver: ``drive(task)`` in a process of its own, at once or when there is a place for it.

        EngineError if it cannot.
        """

    def poll(self) -> tuple[int, list[str]]:
        """Return how many drivers wait or work, and a line on each that was ended by a fault since the last call."""

    def close(self) -> None:
        """End all drivers that are left, and whatever was started for them."""


def open_engine(name: str, scheduler: str, count: int, out: Path) -> Engine:
    """Open an engine for ``count`` drivers. ``scheduler``: as for ``--scheduler``, or empty; ``out``: absolute.

    EngineError if there is no such engine, its packages are missing, or it cannot be used here.
    """
    if name not in ENGINES:
        raise EngineError(f"no such engine {name!r}; {hint(name, ENGINES)}")
    try:
        module = import_module(f"{__name__}.{name}")
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ENGINES[name]:
            raise
        raise EngineError(f"{name} needs the package {error.name}: {install_advice(name)}") from error
    return cast(Engine, module.opened(scheduler, count, out))
