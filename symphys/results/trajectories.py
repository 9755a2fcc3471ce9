"""The motion of a run folder: trajectory.npz and guess.npz."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from symphys.findings import values
from symphys.results.drawable import largest, oversized
from symphys.results.records import Array, ReportError, Trajectory

TRAJECTORY = "trajectory.npz"
GUESS = "guess.npz"

UNREADABLE = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError, MemoryError)
"""What numpy and zipfile raise at files that are no archives of plain arrays."""


def read_trajectory(path: Path) -> Trajectory:
    """Read a recorded motion, up to the first state that is not finite.

    Raises:
        ReportError: no such file, not an archive of plain arrays, shapes that do not fit, or numbers beyond what can be
            drawn.
    """
    try:
        with path.open("rb") as file:
            arrays = unpack(np.load(file, allow_pickle=False))
    except FileNotFoundError as error:
        raise ReportError(f"{path.name}: there is no such file") from error
    except UNREADABLE as error:
        raise ReportError(f"{path.name}: not an archive of plain arrays ({values.name(str(error))})") from error
    try:
        motion = trim(make_trajectory(arrays))
    except (ValueError, KeyError, TypeError) as error:
        raise ReportError(f"{path.name}: not a recorded motion ({values.name(str(error))})") from error
    for name, array in vars(motion).items():
        if oversized(array):
            raise ReportError(f"{path.name}: {name} has numbers up to {largest(array):.3g}, which cannot be drawn")
    return motion


def unpack(content: object) -> dict[str, Array]:
    """Every array of an archive; ValueError for anything else that numpy reads."""
    if not isinstance(content, np.lib.npyio.NpzFile):
        raise ValueError("one array, not an archive of several")
    with content as archive:
        return {key: archive[key] for key in archive.files}


def make_trajectory(arrays: Mapping[str, Array]) -> Trajectory:
    """Check the shapes; quantities that are absent become nan, orientations the identity."""
    time = np.asarray(arrays["time"], float).reshape(-1)
    count, bodies = shape_of(arrays["position"], time.size)
    contacts, joints = names_of(arrays, "contact_names"), names_of(arrays, "joint_names")
    value = np.asarray(arrays.get("joint_value", np.zeros((0, 0, 0))))
    along = (len(joints), value.shape[2] if value.ndim == 3 else 0)

    def quantity(key: str, shape: tuple[int, ...], missing: float = np.nan) -> Array:
        read = np.asarray(arrays[key], float) if key in arrays else np.full(shape, missing)
        if read.shape != shape:
            raise ValueError(f"{key} has shape {read.shape}, {shape} is expected")
        return read

    orientation = np.broadcast_to(np.array([1.0, 0.0, 0.0, 0.0]), (count, bodies, 4))
    return Trajectory(
        time=time,
        body_names=names_of(arrays, "body_names", bodies),
        position=quantity("position", (count, bodies, 3)),
        orientation=quantity("orientation", (count, bodies, 4)) if "orientation" in arrays else orientation,
        velocity=quantity("velocity", (count, bodies, 3)),
        angular_velocity=quantity("angular_velocity", (count, bodies, 3)),
        force=quantity("force", (count - 1, bodies, 3), 0.0),
        torque=quantity("torque", (count - 1, bodies, 3), 0.0),
        contact_names=contacts,
        contact_force=quantity("contact_force", (count - 1, len(contacts), 3), 0.0),
        contact_gap=quantity("contact_gap", (count, len(contacts))),
        joint_names=joints,
        joint_value=quantity("joint_value", (count, *along)),
        joint_rate=quantity("joint_rate", (count, *along)),
        joint_torque=quantity("joint_torque", (count - 1, *along)),
        joint_command=quantity("joint_command", (count - 1, *along)),
        joint_separation=quantity("joint_separation", (count, len(joints))),
    )


def shape_of(position: Array, times: int) -> tuple[int, int]:
    """Number of times and bodies."""
    if position.ndim != 3 or position.shape[2] != 3 or position.shape[0] != times or 0 in position.shape:
        raise ValueError(f"position has shape {position.shape}, ({times}, bodies, 3) is expected")
    return position.shape[0], position.shape[1]


def names_of(arrays: Mapping[str, Array], key: str, count: int | None = None) -> tuple[str, ...]:
    """Names as text; bodies without names are numbered."""
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
    cut: dict[str, Any] = {
        name: array[:keep] for name, array in vars(trajectory).items() if isinstance(array, np.ndarray)
    }
    for name in ("force", "torque", "contact_force", "joint_torque", "joint_command"):
        cut[name] = cut[name][: keep - 1]
    return replace(trajectory, **cut)
