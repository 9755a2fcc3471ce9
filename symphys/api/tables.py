"""Solutions as tables of pandas and xarray, where these are installed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from symphys.errors import SymphysError
from symphys.results.trace import Trace
from symphys.trajectory import Trajectory

AXES = {3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}
"""Names of the components of vectors and quaternions."""


def trace_frame(trace: Trace) -> Any:
    """A DataFrame of the iterations."""
    return library("pandas").DataFrame(dict(trace.columns)).set_index("iteration")


def motion_frame(motion: Trajectory) -> Any:
    """A DataFrame with a column for each number over "time"."""
    pandas = library("pandas")
    return pandas.DataFrame(columns(motion), index=pandas.Index(motion.time, name="time"))


def to_xarray(motion: Trajectory) -> Any:
    """A Dataset with a variable for each quantity over "time"; the last row of what acts during a step is nan."""
    xarray = library("xarray")
    found = {}
    for name, unit in motion.units.items():
        values = lengthened(motion[name], len(motion.time))
        if name != "time":
            dims = ("time",) if values.ndim == 1 else ("time", {3: "axis", 4: "quaternion"}.get(values.shape[1], name))
            found[name] = (dims, values, {"units": unit})
    coordinates = {"time": ("time", motion.time, {"units": "s"}), "axis": list(AXES[3]), "quaternion": list(AXES[4])}
    return xarray.Dataset(found, coords=coordinates)


def columns(motion: Trajectory) -> dict[str, Any]:
    """Each number over time by its name: ``ball.position.x``; the last row of what acts during a step is nan."""
    found = {}
    for name in motion.units:
        values = lengthened(motion[name], len(motion.time))
        if name == "time":
            continue
        if values.ndim == 1:
            found[name] = values
            continue
        components = AXES.get(values.shape[1], tuple(map(str, range(values.shape[1]))))
        found |= {f"{name}.{component}": values[:, k] for k, component in enumerate(components)}
    return found


def lengthened(values: Any, count: int) -> Any:
    """With a row of nan at the end where there is one too few."""
    missing = np.full((count - len(values), *values.shape[1:]), np.nan)
    return np.concatenate([values, missing])


def library(name: str) -> Any:
    """A package that need not be there; SymphysError says how to get it."""
    try:
        return import_module(name)
    except ImportError:
        raise SymphysError(f"this needs {name}: pip install {name}") from None
