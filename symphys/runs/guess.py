"""Another run as the guess: its variables, resampled onto the problem's knots, its motion, its multipliers."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from symphys.errors import SymphysError
from symphys.problem import Problem, Variable, load_problem
from symphys.problem.guess import GuessedMotion, recorded_guess
from symphys.records import dataclass
from symphys.results.config import read_config
from symphys.results.discovery import is_run_folder, run_folders
from symphys.results.file_names import CONFIG, MULTIPLIERS, PROBLEM, TRAJECTORY
from symphys.results.run import read_run
from symphys.results.text_files import read_archive
from symphys.results.trajectories import read_trajectory
from symphys.trajectory import Trajectory
from symphys.types import Array

DIGEST_DIGITS = 8
"""Digits of the digest in the names of folders."""


@dataclass(frozen=True, eq=False)
class RunGuess:
    """The solution of a run, as the initial guess of others.

    Attributes:
        folder: of the run, as it was given.
        values: by the names of variables (components, knots).
        interpolations: of those that act over time, where they are known.
        motion: that of the solution; None where it is not recorded.
        multipliers: see ``symphys.solvers.Outcome``; empty where there are none.
        digest: of all that is taken from the run.
    """

    folder: str
    values: Mapping[str, Array]
    interpolations: Mapping[str, str]
    motion: Trajectory | None
    multipliers: Mapping[str, Array]
    digest: str


@dataclass(frozen=True)
class GuessOrigin:
    """The run from which the guess of a problem was taken.

    Attributes:
        folder: of the run, as it was given.
        digest: of all that was taken.
        notes: a sentence for each variable that was not taken as it is.
        multipliers: of the run.
    """

    folder: str = ""
    digest: str = ""
    notes: tuple[str, ...] = ()
    multipliers: Mapping[str, Array] = field(default_factory=dict, repr=False)

    @property
    def word(self) -> str:
        """The part of a folder's name that distinguishes guesses; empty without one."""
        return f"guess={self.digest[:DIGEST_DIGITS]}" if self.digest else ""


OWN_GUESS = GuessOrigin()
"""The guess of the problem file itself."""


def read_guess_run(folder: str | Path) -> RunGuess:
    """Read the solution of a run; SymphysError if the folder is not that of a run, or the run has no solution."""
    path = Path(folder)
    if not is_run_folder(path):
        inside = run_folders(path)[:1] if path.is_dir() else []
        there = inside[0] if inside else "reports/ball_throw/gradient-seed0"
        raise SymphysError(f"guess: {path} is no run folder; one is, for instance, {there}")
    run = read_run(path, path)
    values = {name: record.value for name, record in run.z.items()}
    if not run.readable or not values or not all(np.isfinite(value).all() for value in values.values()):
        why = "; ".join(run.faults) or f"it found nothing: {run.advice or run.status}"
        raise SymphysError(f"guess: {path} has no variables to take: {why}")
    motion = read_trajectory(path / TRAJECTORY) if (path / TRAJECTORY).exists() else None
    multipliers = read_archive(path / MULTIPLIERS) if (path / MULTIPLIERS).exists() else {}
    found = interpolations(path)
    arrays = [*values.items(), *multipliers.items(), *(motion.arrays().items() if motion else ())]
    digest = hashlib.sha256(repr(sorted(found.items())).encode())
    for name, array in arrays:
        digest.update(name.encode() + np.ascontiguousarray(array).tobytes())
    return RunGuess(str(folder), values, found, motion, multipliers, digest.hexdigest())


def interpolations(path: Path) -> dict[str, str]:
    """Return the interpolation of each control of the problem in a run folder; empty if it cannot be read."""
    try:
        problem = load_problem(path / PROBLEM, read_config(path / CONFIG).settings)
    except SymphysError:
        return {}
    return {each.name: each.interpolation for each in problem.variables if each.kind == "control"}


def with_guess(problem: Problem, guess: RunGuess) -> tuple[Problem, GuessOrigin]:
    """Return the problem with a run's variables and motion as its guess; SymphysError where nothing of the run fits.

    Knots of another number, or of a motion of another duration, lie at the same shares of the duration. The motion
    takes the duration of the problem, and rates change with it. Variables keep what the problem says where the run has
    none of their name and size.
    """
    notes, variables = list[str](), []
    taken = 0
    for variable in problem.variables:
        value, note = taken_value(variable, guess)
        notes += [note] if note else []
        taken += value is not None
        variables.append(variable if value is None else replace(variable, guess=value))
    guessed = replace(problem, variables=tuple(variables))
    motion = guessed_motion(guessed, guess.motion)
    if not taken and (motion is None or not motion.columns):
        raise SymphysError(
            f"guess: nothing of {guess.folder} fits {problem.name}: the run has {words(guess.values)}, the problem "
            f"{words(each.name for each in problem.variables)}, and no body or joint in common"
        )
    if motion is not None and motion.columns:
        guessed = replace(guessed, guess=motion)
    return guessed, GuessOrigin(guess.folder, guess.digest, tuple(notes), guess.multipliers)


def words(names: Iterable[str]) -> str:
    """Join names for a message."""
    return ", ".join(names) or "no variables"


def taken_value(variable: Variable, guess: RunGuess) -> tuple[Array | None, str]:
    """Return a variable's guess (components * knots,) within its bounds, or None; and a note, or an empty text."""
    name = variable.name
    if name not in guess.values:
        return None, f"{name}: the run has no variable of this name; its guess is the problem's"
    value = guess.values[name]
    over_time = variable.kind == "control"
    if value.shape[0] != variable.components or (value.shape[1] != variable.knots and not over_time):
        sizes = f"{value.shape[0]} x {value.shape[1]} numbers in the run, {variable.components} x {variable.knots} here"
        return None, f"{name}: {sizes} (components x knots); its guess is the problem's"
    before = guess.interpolations.get(name, variable.interpolation)
    flat = resampled(value, before, variable.knots, variable.interpolation).ravel(order="F")
    clipped = np.clip(flat, variable.lower, variable.upper)
    count = int(np.count_nonzero(clipped != flat))
    return clipped, f"{name}: {count} of {flat.size} numbers are clipped to the bounds" if count else ""


def guessed_motion(problem: Problem, motion: Trajectory | None) -> GuessedMotion | None:
    """Return the motion over the duration of the problem's file, with rates for the duration that is guessed."""
    if motion is None or not motion.time[-1] > 0:
        return None
    taken = float(motion.time[-1])
    chosen = [float(each.guess[0]) for each in problem.variables if each.kind == "duration"]
    duration = problem.simulation.duration
    recorded = {name: motion[name] for name in motion.units if len(motion[name]) == len(motion.time)}
    pace = taken / (chosen[0] if chosen else duration)
    return recorded_guess(problem.world(), motion.time * (duration / taken), recorded, pace)


def resampled(values: Array, before: str, count: int, after: str) -> Array:
    """Return the control (components, count) on other knots, at the same fractions of the duration.

    Args:
        values: (components, knots).
        before: its interpolation: "constant", each knot over an equal part of the duration, or "linear", knots at equal
            distances from the start to the end.
        count: of the new knots.
        after: their interpolation. Linear knots are values of the control, whose constant parts are joined at their
            middles; constant ones are its means over their parts.
    """
    knots = values.shape[1]
    if knots == count and (before == after or count == 1):
        return values
    steps = before == "constant" or knots == 1
    if after == "linear" and count > 1:
        places = (np.arange(knots) + 0.5) / knots if steps else np.linspace(0, 1, knots)
        return np.stack([np.interp(np.linspace(0, 1, count), places, row) for row in values])
    edges = np.linspace(0, 1, count + 1)
    return np.stack([np.diff(step_areas(row, edges) if steps else line_areas(row, edges)) * count for row in values])


def step_areas(row: Array, edges: Array) -> Array:
    """Integrate from 0 to the edges over steps of equal length on [0, 1]."""
    areas = np.concatenate([[0], np.cumsum(row)]) / len(row)
    return np.asarray(np.interp(edges, np.linspace(0, 1, len(row) + 1), areas))


def line_areas(row: Array, edges: Array) -> Array:
    """Integrate from 0 to the edges over line segments between equidistant numbers on [0, 1]."""
    knots = np.linspace(0, 1, len(row))
    places = np.union1d(knots, edges)
    values = np.interp(places, knots, row)
    areas = np.concatenate([[0], np.cumsum(np.diff(places) * (values[1:] + values[:-1]) / 2)])
    return np.asarray(np.interp(edges, places, areas))
