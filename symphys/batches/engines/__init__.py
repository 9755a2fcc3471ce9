"""Engines by name: what starts the drivers of a batch elsewhere. Each is a module, imported when it is asked for."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import cast

from symphys.batches.engines.interface import Engine, EngineError
from symphys.suggest import hint

__all__ = ["ENGINES", "Engine", "EngineError", "open_engine"]

ENGINES = {"dask": ("dask", "distributed"), "slurm": ("submitit",)}
"""The packages that each needs; the extra has the engine's name."""


def open_engine(name: str, scheduler: str, count: int, out: Path) -> Engine:
    """An engine for ``count`` drivers. ``scheduler``: as ``--scheduler``, empty for its default; ``out``: absolute.

    EngineError if there is no such engine, its packages are missing, or it cannot be used here.
    """
    if name not in ENGINES:
        raise EngineError(f"no such engine {name!r}; {hint(name, ENGINES)}")
    try:
        module = import_module(f"{__name__}.{name}")
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ENGINES[name]:
            raise
        raise EngineError(f'{name} needs the package {error.name}: pip install "symphys[{name}]"') from error
    return cast(Engine, module.opened(scheduler, count, out))
