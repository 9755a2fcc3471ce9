"""The worst recordings, simulated with what was found, beside what was measured."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from symphys.prediction.residuals import RecordingResiduals, difference
from symphys.problem import Problem
from symphys.results.identification import Identification
from symphys.results.identification.replays import RecordingReplay, ReplayedQuantity
from symphys.results.scene import Scene
from symphys.results.scene_of_problem import make_scene
from symphys.trajectory import Trajectory, shapes
from symphys.types import Array

MOST = 3
"""Recordings that are replayed."""
POSE = re.compile(r"(?P<body>[^.]+)\.(?P<field>position|orientation)(\[(?P<component>[0-9])\])?")
"""A quantity that is a pose, or one number of it."""


def worst_replays(
    problem: Problem, residuals: RecordingResiduals, found: Identification
) -> tuple[tuple[RecordingReplay, ...], Scene]:
    """The recordings with the largest residuals, and the world of the first of them."""
    names = [name for name, _ in found.worst(MOST)]
    shared = np.array([each.value for each in found.parameters])
    replays = tuple(_replay(residuals, found, shared, found.recordings.index(name)) for name in names)
    predictor = residuals.predictor
    z = predictor.by_variable(shared, found.own[found.recordings.index(names[0])], found.recordings.index(names[0]))
    return replays, make_scene(problem, z, replays[0].motion)


def _replay(residuals: RecordingResiduals, found: Identification, shared: Array, k: int) -> RecordingReplay:
    predictor = residuals.predictor
    taken, own = predictor.recordings[k], found.own[k]
    motion, last, time = predictor.motion(shared, own, k)
    (sampled,) = predictor.values(shared, found.own, [k])
    motion = shortened(motion, last)
    quantities, poses = list[ReplayedQuantity](), dict[tuple[str, str], Array]()
    for each, unit, predicted, factor in residuals.columns(k, sampled):
        if each.orientation:
            off = -difference(each, predicted)
            quantities.append(ReplayedQuantity(each.name, "rad", off, np.zeros_like(off)))
        else:
            measured = predicted - difference(each, predicted) if each.angle else factor * each.values
            quantities.append(ReplayedQuantity(each.name, unit, measured, factor * predicted))
        if (pose := POSE.fullmatch(each.value.text)) and pose["body"] in motion.body_names:
            key = pose["body"], pose["field"]
            whole = poses.setdefault(key, simulated(motion, *key, time))
            columns = slice(None) if pose["component"] is None else [int(pose["component"])]
            whole[:, columns] = each.values if each.orientation else factor * each.values
    bodies = tuple(dict.fromkeys(body for body, field in poses if field == "position"))
    turned = [poses.get((name, "orientation"), simulated(motion, name, "orientation", time)) for name in bodies]
    n = len(time)
    return RecordingReplay(
        name=taken.name,
        held_back=taken.held_back,
        ratio=float(found.recording_ratio[k]),
        time=time,
        quantities=tuple(quantities),
        bodies=bodies,
        position=np.stack([poses[name, "position"] for name in bodies], 1) if bodies else np.zeros((n, 0, 3)),
        orientation=np.stack(turned, 1) if bodies else np.zeros((n, 0, 4)),
        motion=motion,
    )


def simulated(motion: Trajectory, body: str, field: str, time: Array) -> Array:
    """(n, 3 or 4): a pose at other times; what was not measured of a pose is that of the simulation."""
    values = motion[f"{body}.{field}"]
    return np.stack([np.interp(time, motion.time, column) for column in values.T], axis=1)


def shortened(motion: Trajectory, steps: int) -> Trajectory:
    """Its first steps."""
    parts: dict[str, Any] = dict(_parts(motion, steps))
    return replace(motion, time=motion.time[: steps + 1], **parts)


def _parts(motion: Trajectory, steps: int) -> Iterator[tuple[str, Array]]:
    lengths = {"N + 1": steps + 1, "N": steps}
    for name, letters in shapes().items():
        if letters and letters[0] in lengths:
            yield name, getattr(motion, name)[: lengths[letters[0]]]
