"""Recordings in an identification folder: the measured and the simulated motion.

| file | holds |
|---|---|
| replays.json | names of recordings, of their quantities and of the bodies whose poses were measured |
| replays/1.npz | the simulated motion, as in trajectory.npz |
| replays/1-measured.npz | what was measured, what is simulated at the same times, measured poses |
| scene.json | the world around it, of the first |
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from pathlib import Path

import numpy as np

from symphys import files
from symphys import json_values as values
from symphys.records import dataclass
from symphys.results.file_names import SCENE
from symphys.results.scene import Scene
from symphys.results.text_files import ReportError, read_archive, read_table
from symphys.results.trajectories import read_trajectory
from symphys.trajectory import Trajectory
from symphys.types import Array

REPLAYS = "replays.json"


@dataclass(frozen=True, eq=False)
class ReplayedQuantity:
    """A quantity over the n times of a recording.

    Attributes:
        name, unit: of the quantity.
        measured: (n, m), nan where a sample is missing; of an orientation (n, 3) the rotation vector [rad] from the
            simulated one.
        simulated: (n, m) at the same times; of an orientation 0.
    """

    name: str
    unit: str
    measured: Array = field(repr=False)
    simulated: Array = field(repr=False)


@dataclass(frozen=True, eq=False)
class RecordingReplay:
    """A recording beside its simulation, in the world's units and frame.

    Attributes:
        name: of the recording.
        held_back: whether it was held back.
        ratio: root mean square of its residuals by noise.
        time: (n,) [s] of the samples, on the simulation's clock.
        quantities: the measured ones.
        bodies: b bodies whose positions were measured.
        position, orientation: (n, b, 3) [m], (n, b, 4) of these; nan where a sample is missing.
        motion: the simulation.
    """

    name: str
    held_back: bool
    ratio: float
    time: Array = field(repr=False)
    quantities: tuple[ReplayedQuantity, ...]
    bodies: tuple[str, ...]
    position: Array = field(repr=False)
    orientation: Array = field(repr=False)
    motion: Trajectory = field(repr=False)


def write_replays(folder: Path, replays: Sequence[RecordingReplay], scene: Scene) -> None:
    """Write the files of the replays; the list last."""
    files.make_folder(folder / "replays")
    listed = []
    for k, each in enumerate(replays, 1):
        arrays = {"time": each.time, "position": each.position, "orientation": each.orientation}
        for q, quantity in enumerate(each.quantities):
            arrays |= {f"measured{q}": quantity.measured, f"simulated{q}": quantity.simulated}
        files.write_npz(folder / "replays" / f"{k}.npz", each.motion.arrays())
        files.write_npz(folder / "replays" / f"{k}-measured.npz", arrays)
        named = [{"name": quantity.name, "unit": quantity.unit} for quantity in each.quantities]
        whole = {"name": each.name, "held_back": each.held_back, "ratio": each.ratio}
        listed.append({**whole, "quantities": named, "bodies": list(each.bodies)})
    files.write_json(folder / SCENE, scene.to_json())
    files.write_json(folder / REPLAYS, {"replays": listed})


def read_replays(folder: Path) -> tuple[RecordingReplay, ...]:
    """Read the replays in a folder; none where there is no list. Raises ReportError."""
    if not (folder / REPLAYS).exists():
        return ()
    listed = read_table(folder / REPLAYS).get("replays")
    return tuple(
        _read(folder, k, values.table(each)) for k, each in enumerate(listed if isinstance(listed, list) else (), 1)
    )


def _read(folder: Path, k: int, entry: dict[str, object]) -> RecordingReplay:
    path = folder / "replays" / f"{k}-measured.npz"
    arrays = read_archive(path)
    named, bodies = entry.get("quantities"), entry.get("bodies")
    quantities = [values.table(each) for each in named] if isinstance(named, list) else []
    try:
        time, found = np.asarray(arrays["time"], float), []
        for q, each in enumerate(quantities):
            pair = (np.asarray(arrays[f"{key}{q}"], float).reshape(len(time), -1) for key in ("measured", "simulated"))
            found.append(ReplayedQuantity(values.name(each.get("name")), values.name(each.get("unit")), *pair))
        names = tuple(map(values.name, bodies)) if isinstance(bodies, list) else ()
        position = np.asarray(arrays["position"], float).reshape(len(time), len(names), 3)
        orientation = np.asarray(arrays["orientation"], float).reshape(len(time), len(names), 4)
    except (KeyError, ValueError, TypeError) as error:
        raise ReportError(f"{path.name}: not a measured motion ({values.name(str(error))})") from error
    motion = read_trajectory(folder / "replays" / f"{k}.npz")
    ratio = values.number(entry.get("ratio"))
    return RecordingReplay(
        values.name(entry.get("name")),
        entry.get("held_back") is True,
        ratio,
        time,
        tuple(found),
        names,
        position,
        orientation,
        motion,
    )
