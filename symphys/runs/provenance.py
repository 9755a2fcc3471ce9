"""Where a result comes from: which run, versions, machine, time."""

from __future__ import annotations

import datetime
import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from symphys import __version__
from symphys.codegen.backends import Description
from symphys.runs.job import Job


def stamp(job: Job) -> dict[str, Any]:
    """The fields of a result that are known however the run ends."""
    return {
        "problem": job.config.problem,
        "title": job.problem.title,
        "solver": job.config.solver,
        "seed": job.config.seed,
        "versions": versions(),
        "when": now(),
        "command": job.command,
    }


def evaluated(backend: Description) -> dict[str, Any]:
    """The "backend" of a result."""
    told = asdict(backend)
    cached, _, _ = told.pop("cached"), told.pop("seconds"), told.pop("later")
    return {**told, "note": backend.said(), "compiled": "" if cached is None else "warm" if cached else "cold"}


def versions() -> dict[str, str]:
    """The versions of all that takes part in a solve, and the platform."""
    return {
        "symphys": __version__,
        "python": platform.python_version(),
        **{name: version(name) for name in ("casadi", "numpy", "scipy", "cma")},
        "platform": f"{platform.system()} {platform.machine()}",
    }


def now() -> str:
    """UTC, ISO 8601, to the second."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
