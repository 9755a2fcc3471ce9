"""Trajectories on disk: trajectory.npz and guess.npz of a run folder, read by the fields of ``Trajectory``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from symphys import json_values as values
from symphys.archives import MOST_BYTES, NUMBER
from symphys.results.drawable import largest, oversized
from symphys.results.text_files import ReportError, read_archive
from symphys.trajectory import Trajectory, shapes
from symphys.types import Array

ABSENT = {"force": 0.0, "torque": 0.0, "contact_force": 0.0}
"""Values of quantities that a file does not have, where that is not nan."""
UNUSED = ("residual", "crowded", "ambiguous", "paradox")
"""Numbers on the contact solver, which no picture of a motion uses."""


POSES = ("time", "body_names", "position", "orientation")
"""The arrays that are read of a guess, of which only the path is drawn: a quarter of the reading time."""


def read_trajectory(path: Path, only: Sequence[str] = ()) -> Trajectory:
    """Read a recorded motion, up to the first state that is not finite; ``only`` these arrays of it, if any are named.

    Raises:
        ReportError: no such file, not an archive of plain arrays, too large, shapes that do not fit, or numbers beyond
            what can be drawn.
    """
    arrays = read_archive(path, only)
    try:
        motion = trim(make_trajectory(arrays))
    except (ValueError, KeyError, TypeError) as error:
        raise ReportError(f"{path.name}: not a recorded motion ({values.name(str(error))})") from error
    for name, array in vars(motion).items():
        if name not in UNUSED and oversized(array):
            raise ReportError(f"{path.name}: {name} has numbers up to {largest(array):.3g}, which cannot be drawn")
    return motion


def make_trajectory(arrays: Mapping[str, Array]) -> Trajectory:
    """Check shapes; absent quantities become nan, forces on bodies and contacts 0, orientations 1."""
    time = np.asarray(arrays["time"], float).reshape(-1)
    count, bodies = shape_of(arrays["position"], time.size)
    contacts, joints = names_of(arrays, "contact_names"), names_of(arrays, "joint_names")
    value = np.asarray(arrays.get("joint_value", np.zeros((0, 0, 0))))
    coordinates = value.shape[2] if value.ndim == 3 else 0
    sizes = {"N + 1": count, "N": count - 1, "B": bodies, "C": len(contacts), "J": len(joints), "K": coordinates}
    expected = {
        name: tuple(sizes[letter] if letter in sizes else int(letter) for letter in letters)
        for name, letters in shapes().items()
    }
    if sum(math.prod(shape) for shape in expected.values()) * NUMBER > MOST_BYTES:
        raise ValueError(
            f"{count} times, {bodies} bodies, {len(contacts)} contacts and {len(joints)} joints are too many"
        )
    found: dict[str, Any] = {}
    for name, shape in expected.items():
        found[name] = np.asarray(arrays[name], float) if name in arrays else np.full(shape, ABSENT.get(name, np.nan))
        if found[name].shape != shape and name not in UNUSED:
            raise ValueError(f"{name} has shape {found[name].shape}, {shape} is expected")
    if "orientation" not in arrays:
        found["orientation"] = np.broadcast_to(np.array([1.0, 0.0, 0.0, 0.0]), (count, bodies, 4))
    found["body_names"] = names_of(arrays, "body_names", bodies)
    units = names_of(arrays, "joint_units")
    found["joint_units"] = units if len(units) == len(joints) else ()
    return Trajectory(time=time, contact_names=contacts, joint_names=joints, **found)


def shape_of(position: Array, times: int) -> tuple[int, int]:
    """Return the numbers of times and bodies."""
    if position.ndim != 3 or position.shape[2] != 3 or position.shape[0] != times or 0 in position.shape:
        raise ValueError(f"position has shape {position.shape}, ({times}, bodies, 3) is expected")
    return position.shape[0], position.shape[1]


def names_of(arrays: Mapping[str, Array], key: str, count: int | None = None) -> tuple[str, ...]:
    """Read names as text; bodies without names are numbered."""
    read = tuple(values.name(str(entry)) for entry in np.atleast_1d(arrays[key])) if key in arrays else ()
    if count is None or len(read) == count:
        return read
    return tuple(f"body {index + 1}" for index in range(count))


def trim(trajectory: Trajectory) -> Trajectory:
    """Keep the leading part whose times and positions are finite."""
    states = np.concatenate([trajectory.position, trajectory.orientation], axis=2)
    finite = np.isfinite(states).all(axis=(1, 2)) & np.isfinite(trajectory.time)
    keep = finite.size if finite.all() else int(np.argmin(finite))
    if keep == 0:
        raise ValueError("no state is finite")
    if keep == finite.size:
        return trajectory
    ends = {"N + 1": keep, "N": keep - 1}
    cut: dict[str, Any] = {name: getattr(trajectory, name)[: ends[letters[0]]] for name, letters in shapes().items()}
    return replace(trajectory, time=trajectory.time[:keep], **cut)
