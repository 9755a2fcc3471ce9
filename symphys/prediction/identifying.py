"""``symphys.identify``: estimates of a problem's variables from recordings; replays of the worst recordings."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from symphys import files
from symphys import identification as numbers
from symphys.errors import SymphysError
from symphys.identification import FitOptions, FitState, FitStep, IdentificationOptions, SearchOptions, revive_state
from symphys.prediction.residuals import RecordingResiduals, difference, residuals_of
from symphys.problem import IdentifySettings, Problem
from symphys.problem.problem import Source, load
from symphys.results.identification import Identification
from symphys.results.identification.replays import RecordingReplay, ReplayedQuantity, write_replays
from symphys.results.scene import Scene
from symphys.results.scene_of_problem import make_scene
from symphys.suggest import hint
from symphys.threads import limited
from symphys.trajectory import Trajectory, shapes
from symphys.types import Array

STATE_FILE = "identification_state.json"
"""The file of an output folder from which an interrupted fit resumes."""
FIRST_DAMPING = 1e-6
"""First damping of the fit: for 285 tosses of a cube 1e-6 gives 0.055e6 in 25 steps, 1e-3 0.30e6 in 15."""
CHOICES = {"loss": ("squares", "huber"), "check": ("none", "cma")}
"""Settings with a fixed set of values."""
Monitor = Callable[[FitStep], None]


def identify(
    problem: Source,
    folder: Path | str | None = None,
    *,
    threads: int | None = None,
    monitor: Monitor | None = None,
    stop: Callable[[], bool] | None = None,
    **settings: Any,
) -> Identification:
    """Estimate a problem's variables from its recordings, with uncertainty and residual analysis.

    Args:
        problem: any argument of ``load``, with [[recording]] tables.
        folder: gets identification.json and identification.npz, and what an interrupted fit goes on from; None: none.
        threads: their number for the simulations; None: one for each processor.
        monitor: is called with each iteration.
        stop: is called after each iteration; True ends the fit there.
        settings: in place of those in [identify]: ``loss="huber"``, ``bootstrap=200``, ``check="cma"``,
            ``horizons=(0.3, 0.5, 0.7, 0.85, 1)``, ``held_back_starts="before impact"``.

    Returns:
        Estimates with intervals, what is not determined, what is left; see ``Identification``. Own numbers of
        recordings that are held back come from where ``held_back_starts`` says, with the shared numbers held.

    Raises:
        ProblemError: the problem file is wrong.
        SymphysError: there is nothing to identify, or a simulation is not finite at the guess.

    Example:
        >>> import symphys
        >>> found = symphys.identify("bounce_recorded")
        >>> round(found["bounce"].value, 2)
        0.75
    """
    loaded = load(problem)
    chosen = with_settings(loaded.identify, settings)
    place = None if folder is None else Path(folder)
    with limited():
        residuals = residuals_of(loaded, threads)
        key = state_key(loaded, chosen)
        start = None if place is None else saved_state(place, key, residuals)

        def save_step(step: FitStep, state: FitState) -> None:
            if place is not None:
                files.write_json(place / STATE_FILE, {"key": key, **state.plain()})
            if monitor is not None:
                monitor(step)

        if place is not None:
            files.make_folder(place)
        found = numbers.identify(residuals, options_of(chosen), start, save_step, stop, loaded.name, loaded.title)
    if place is not None:
        write_replays(place, *worst_replays(loaded, residuals, found))
        found.write(place)
        if found.status != numbers.FitStatus.INTERRUPTED.value:
            files.remove(place / STATE_FILE)
    return found


def with_settings(given: IdentifySettings, settings: dict[str, Any]) -> IdentifySettings:
    """Replace settings of the file; SymphysError names an unknown setting or an invalid value."""
    for name in settings:
        if name not in vars(given):
            raise SymphysError(f"identify has no setting {name!r}; {hint(name, vars(given))}")
        if name in CHOICES and settings[name] not in CHOICES[name]:
            raise SymphysError(f"{name} is {settings[name]!r}: {hint(str(settings[name]), CHOICES[name])}")
    return replace(given, **settings)


def options_of(settings: IdentifySettings) -> IdentificationOptions:
    """Return the options of the identification."""
    threshold = settings.threshold if settings.loss == "huber" else math.inf
    search = SearchOptions(settings.check_evaluations, seed=settings.seed) if settings.check == "cma" else None
    horizons = tuple(map(float, settings.horizons))
    fit = FitOptions(settings.iterations, FIRST_DAMPING, settings.tolerance, threshold=threshold, horizons=horizons)
    draws, starts, seed = settings.bootstrap, settings.held_back_starts, settings.seed
    return IdentificationOptions(fit, draws=draws, search=search, held_back_starts=starts, seed=seed)


def state_key(problem: Problem, settings: IdentifySettings) -> str:
    """Return a key that is equal for the same problem, recordings and settings."""
    return sha256(f"{problem.identity}\n{dict(problem.settings)}\n{settings}".encode()).hexdigest()


def saved_state(folder: Path, key: str, residuals: RecordingResiduals) -> FitState | None:
    """Read the state of an interrupted fit of the same problem; None without one."""
    if not (folder / STATE_FILE).exists():
        return None
    saved = files.read_json(folder / STATE_FILE)
    return revive_state(saved, residuals) if isinstance(saved, dict) and saved.get("key") == key else None


MAX_REPLAYS = 3
"""Largest number of replayed recordings."""
POSE = re.compile(r"(?P<body>[^.]+)\.(?P<field>position|orientation)(\[(?P<component>[0-9])\])?")
"""Pattern of a quantity that is a pose, or one number of it."""


def worst_replays(
    problem: Problem, residuals: RecordingResiduals, found: Identification
) -> tuple[tuple[RecordingReplay, ...], Scene]:
    """Return the recordings with the largest residuals, and the world of the first of them."""
    names = [name for name, _ in found.worst(MAX_REPLAYS)]
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
    """Interpolate a simulated pose at other times: (n, 3 or 4)."""
    values = motion[f"{body}.{field}"]
    return np.stack([np.interp(time, motion.time, column) for column in values.T], axis=1)


def shortened(motion: Trajectory, steps: int) -> Trajectory:
    """Return the first steps of a motion."""
    parts: dict[str, Any] = dict(_parts(motion, steps))
    return replace(motion, time=motion.time[: steps + 1], **parts)


def _parts(motion: Trajectory, steps: int) -> Iterator[tuple[str, Array]]:
    lengths = {"N + 1": steps + 1, "N": steps}
    for name, letters in shapes().items():
        if letters and letters[0] in lengths:
            yield name, getattr(motion, name)[: lengths[letters[0]]]
