"""Predictions of a problem for each of its recordings, and their derivatives by the identified numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from symphys.expression import parse
from symphys.model.joints.joint import UNWRAPPED
from symphys.prediction.parameters import number_blocks
from symphys.prediction.rotations import turned
from symphys.problem import Problem, RecordedInput, Recording, Variable, VariableSlot
from symphys.records import dataclass
from symphys.trajectory import Trajectory
from symphys.transcription.quantity_slopes import QuantitySlopes
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.sampler import hidden
from symphys.transcription.simulation import recorder, simulate
from symphys.types import Array

JUMP_TOLERANCE = 1e-9
"""Distance [steps] from the end of a step within which a jump is at the end."""


def input_variables(recordings: Iterable[Recording], steps: int) -> tuple[Variable, ...]:
    """Return a variable for each recorded input, with a knot for each step; no solver chooses it."""
    sizes = {name: each.values.shape[1] for recording in recordings for name, each in recording.inputs.items()}
    return tuple(
        hidden(f"{name}:recorded", "control", VariableSlot(name, tuple(range(size))), np.zeros(size * steps), steps)
        for name, size in sizes.items()
    )


def delays(recording: Recording) -> Mapping[str, float]:
    """Return the delays [s] of a recording's inputs by name: ``knee.command.delay``."""
    return {f"{name}.delay": each.delay for name, each in recording.inputs.items()}


def step_means(recorded: RecordedInput, steps: int, dt: float, delay: float) -> tuple[Array, Array]:
    """Return (steps, m) the inputs of the steps, and (steps, m) their derivatives by the delay [s].

    Inputs act over a whole step. That of step k is the mean of the recorded one over the step, so that its impulse is
    exact, whatever the rates of samples and steps:

        u_k = 1 / dt * integral of s(t - delay) from t_k to t_k + dt
        d u_k / d delay = (s(t_k - delay) - s(t_k + dt - delay)) / dt

    The derivative is exact for lines between samples and for samples that are held. Of the latter u_k has a kink where
    a jump meets the end of a step; the derivative there is that towards later.

    Args:
        recorded: with samples at times (k,) [s].
        steps: their number.
        dt: [s] their length.
        delay: [s] by which what was recorded acts later, on the clock of the simulation.
    """
    edges = np.arange(steps + 1, dtype=np.float64) * dt - delay
    values, integral = _signal(recorded, edges, JUMP_TOLERANCE * dt)
    return np.diff(integral, axis=0) / dt, -np.diff(values, axis=0) / dt


def _signal(recorded: RecordedInput, at: Array, slack: float) -> tuple[Array, Array]:
    """Return (n, m) the signal just before times (n,), and its integral from the first sample."""
    time, values = recorded.time, recorded.values
    span, rise = np.diff(time)[:, None], np.diff(values, axis=0)
    slopes = rise / span if recorded.interpolation == "linear" else np.zeros_like(rise)
    slopes = np.concatenate([slopes, np.zeros_like(values[:1])])
    areas = np.cumsum(span * (values[:-1] + span * slopes[:-1] / 2), axis=0)
    areas = np.concatenate([np.zeros_like(values[:1]), areas])
    first = np.searchsorted(time, at - slack, side="left") - 1
    before, first = (first < 0)[:, None], np.maximum(first, 0)
    slope, since = np.where(before, 0.0, slopes[first]), (at - time[first])[:, None]
    found = values[first] + slope * since
    return found, areas[first] + since * (values[first] + found) / 2


SAMPLE_TOLERANCE = 1e-9
"""Distance [steps] from the start of a step within which a sample is at the start."""
SCALED_FIELDS = ("position", "velocity")
"""Fields of a start that a scale of lengths multiplies."""


@dataclass(frozen=True)
class PredictedSamples:
    """The prediction of a recording.

    Attributes:
        values: (n, m) the quantities at its samples, of the world, not scaled.
        slopes: (n, m, s + o) by shared and own numbers; None where it was not asked for.
        scale: of its lengths: measured ones times this are those of the world.
        by_scale: (s + o,) the derivative of the scale.
    """

    values: Array
    slopes: Array | None
    scale: float
    by_scale: Array


class Predictor:
    """Simulates recordings: the measured quantities at the times of the samples.

    The simulation's z has first what recordings set at the start, then what drives it, then the problem's variables.

    Attributes:
        recordings: the predicted ones.
        shared, own: blocks of the numbers that are identified.
        sizes: by the text of a formula, how many numbers it has.
        starts: (K, n) z at the guess.
    """

    def __init__(self, problem: Problem, recordings: Sequence[Recording], threads: int | None = None) -> None:
        """Trace the simulation, which is compiled at first use; KernelUnavailable without a compiler."""
        self.recordings, self.dt = tuple(recordings), problem.simulation.dt
        last = math.ceil(max(r.time[-1] for r in self.recordings) / self.dt - SAMPLE_TOLERANCE)
        steps = max(last, problem.simulation.steps) + 2
        self._given = (*given_variables(problem, self.recordings), *input_variables(self.recordings, steps))
        ends = np.cumsum([0, *(variable.guess.size for variable in self._given)]).tolist()
        self._parts = [slice(*pair) for pair in pairwise(ends)]
        self.shared, self.own = number_blocks(problem, ends[-1])
        simulation = replace(problem.simulation, duration=steps * self.dt)
        whole = replace(problem, simulation=simulation, variables=(*self._given, *problem.variables))
        formulas = {m.value.text: m.value for r in self.recordings for m in r.measured}
        velocities = {text: parse(text) for text in (f"{body.name}.velocity" for body in problem.world().bodies)}
        self._variables = whole.variables
        watched = {text: formula for text, formula in velocities.items() if text not in formulas}
        driven = [variable.name for variable in self._given if variable.kind == "control"]
        rollout = symbolic_rollout(whole, asked=formulas.values())
        self._motion = QuantitySlopes(rollout, formulas, threads=threads, by_step=driven, watched=watched)
        self.sizes = {text: self._motion.sizes[text] for text in formulas}
        self._velocities, self._gravity = tuple(velocities), np.asarray(problem.world().gravity, float)
        guess = np.concatenate([variable.guess for variable in whole.variables])
        self._nominal = problem.parametric.starts()
        self.starts = np.array([self._start(each, guess) for each in self.recordings])
        self._recorded = np.array([self._coordinates(each) for each in self.recordings])

    def values(self, shared: Array, own: Array, which: Sequence[int]) -> Iterator[PredictedSamples]:
        """Predict the recordings at shared (s,) and own (K, o) numbers."""
        set_ = [self._set(shared, own[k], k) for k in which]
        lasts = [each.last(self._motion.steps) for each in set_]
        for each, samples in zip(set_, self._motion.values(np.array([e.z for e in set_]), lasts), strict=True):
            yield PredictedSamples(interpolated(samples, each.at)[0], None, each.scale, each.by_scale)

    def slopes(self, shared: Array, own: Array, which: Sequence[int]) -> Iterator[PredictedSamples]:
        """Predict the recordings, with derivatives by shared and own numbers."""
        set_ = [self._set(shared, own[k], k) for k in which]
        lasts = [each.last(self._motion.steps) for each in set_]
        z, along = np.array([each.z for each in set_]), np.array([each.along for each in set_])
        for each, (samples, slopes) in zip(set_, self._motion.slopes(z, along, lasts), strict=True):
            values, rates = interpolated(samples, each.at)
            by = interpolated(slopes, each.at)[0] + rates[:, :, None] * (each.by_offset / self.dt)
            yield PredictedSamples(values, by, each.scale, each.by_scale)

    def impacts(self, shared: Array, own: Array, which: Sequence[int]) -> Iterator[Array]:
        """Yield the times (i,) [s] of impacts of the recordings, on their clocks."""
        set_ = [self._set(shared, own[k], k) for k in which]
        lasts = [each.last(self._motion.steps) for each in set_]
        z = np.array([each.z for each in set_])
        for each, k, velocity in zip(set_, which, self._motion.values(z, lasts, self._velocities), strict=True):
            offset = float(each.at[0]) * self.dt - float(self.recordings[k].time[0])
            yield impact_times(velocity.reshape(len(velocity), -1, 3), self._gravity, self.dt) - offset

    def motion(self, shared: Array, own: Array, k: int) -> tuple[Trajectory, int, Array]:
        """Return a recording's motion by the exact rollout, the number of its measured steps, and its start time."""
        each, rollout = self._set(shared, own, k), self._motion.rollout
        record = simulate(rollout, recorder(rollout), each.z, 0.0)
        return record.motion, each.last(rollout.steps), each.at * self.dt

    def by_variable(self, shared: Array, own: Array, k: int) -> dict[str, Array]:
        """Return the simulation's inputs for a recording, by variable: (components, 1) each."""
        z, found, place = self._set(shared, own, k).z, dict[str, Array](), 0
        for variable in self._variables:
            found[variable.name] = z[place : place + variable.guess.size].reshape(variable.knots, -1).T
            place += variable.guess.size
        return found

    def _set(self, shared: Array, own: Array, k: int) -> _Set:
        """Return the simulation's inputs for a recording, with derivatives."""
        # Nominal inputs; offset, scale and delays of the recording.
        recording, width = self.recordings[k], len(shared)
        z, along = self.starts[k].copy(), np.zeros((self.starts.shape[1], width + len(own)))
        offset, scale = f"{recording.table}.offset", f"{recording.table}.scale"
        measured = {offset: 0.0, scale: 1.0, **delays(recording)}
        by = {key: np.zeros(width + len(own)) for key in measured}
        both = [(block, shared, 0) for block in self.shared] + [(block, own, width) for block in self.own]
        # Numbers take their places in z, rotation vectors by the exponential map.
        for block, numbers, first in both:
            columns = first + np.arange(block.part.start, block.part.stop)
            if block.variable.kind == "recording":
                for name in measured.keys() & {slot.name for slot in block.variable.slots}:
                    measured[name] = float(numbers[block.first])
                    by[name][columns] = 1
            elif block.turns:
                z[block.where], along[np.ix_(block.where, columns)] = turned(z[block.where], numbers[block.part])
            else:
                z[block.where], along[block.where, columns] = numbers[block.part], 1
                z[block.where] -= self._recorded[k, block.where]
        # Recorded inputs are resampled with their delay; recorded lengths are scaled.
        for variable, part in zip(self._given, self._parts, strict=True):
            name = variable.slots[0].name
            if name in recording.inputs:
                late, by_late = measured[f"{name}.delay"] + measured[offset], by[f"{name}.delay"] + by[offset]
                means, slopes = step_means(recording.inputs[name], variable.knots, self.dt, late)
                z[part], along[part] = means.ravel(), np.outer(slopes, by_late)
            elif name.rpartition(".")[2] in SCALED_FIELDS:
                along[part] += np.outer(z[part], by[scale])
                z[part] *= measured[scale]
        at = (recording.time + measured[offset]) / self.dt
        return _Set(z, along, at, by[offset], measured[scale], by[scale])

    def _start(self, recording: Recording, guess: Array) -> Array:
        """Return z (n,) of the guess with the values that the recording sets."""
        z = guess.copy()
        for variable, part in zip(self._given, self._parts, strict=True):
            z[part] = recording.start.get(variable.slots[0].name, variable.guess)
        for block in self.own:
            slot = block.variable.slots[0]
            if slot.name in recording.coordinates:
                z[block.where] = self._nominal[slot.name][list(slot.components)]
            elif slot.name in recording.start:
                z[block.where] = recording.start[slot.name][list(slot.components)]
        return z

    def _coordinates(self, recording: Recording) -> Array:
        """Return (n,) the recorded joint coordinates at the start, where own numbers set these; else 0."""
        by = np.zeros(self.starts.shape[1])
        for block in self.own:
            slot = block.variable.slots[0]
            if slot.name in recording.coordinates:
                by[block.where] = (recording.coordinates[slot.name] - self._nominal[slot.name])[list(slot.components)]
        return by

    def guesses(self, own: bool) -> Array:
        """Return (s,) or (K, o) the guesses of shared or own numbers."""
        blocks = self.own if own else self.shared
        starts = self.starts + self._recorded if own else self.starts[0]
        found = np.zeros((*starts.shape[:-1], blocks[-1].part.stop if blocks else 0))
        for block in blocks:
            if not block.turns:
                found[..., block.part] = starts[..., block.where]
        return found


@dataclass(frozen=True)
class _Set:
    """z (n,) of a recording with derivatives (n, s + o), places of samples in steps, and scale of lengths."""

    z: Array
    along: Array
    at: Array
    by_offset: Array
    scale: float
    by_scale: Array

    def last(self, steps: int) -> int:
        """Return the last state that is needed."""
        return int(min(max(math.floor(self.at[-1] + SAMPLE_TOLERANCE) + 1, 1), steps - 1))


def given_variables(problem: Problem, recordings: Sequence[Recording]) -> tuple[Variable, ...]:
    """Return the initial values that recordings set, as variables that no solver chooses."""
    names = dict.fromkeys(name for recording in recordings for name in recording.start)
    nominal = problem.initial | {
        f"{joint.name}.{UNWRAPPED}": problem.parametric.starts()[f"{joint.name}.start"]
        for joint in problem.parametric.joints
        if joint.kind.winds
    }
    return tuple(_given(name, nominal[name]) for name in names)


def _given(name: str, nominal: Array) -> Variable:
    return hidden(f"{name}:recorded", "initial", VariableSlot(name, tuple(range(nominal.size))), nominal)


def interpolated(samples: Array, at: Array) -> tuple[Array, Array]:
    """Interpolate rows of samples (steps, ...) at places in steps (n,): (n, ...), and the derivative by place."""
    first = np.clip(np.floor(at + SAMPLE_TOLERANCE).astype(int), 0, len(samples) - 2)
    share = np.clip(at - first, 0, 1).reshape(-1, *[1] * (samples.ndim - 1))
    share = np.where(share < SAMPLE_TOLERANCE, 0.0, share)
    rise = samples[first + 1] - samples[first]
    return np.where(share == 0, samples[first], samples[first] + share * rise), rise


MIN_JUMP_SHARE = 0.1
"""Least jump of a body's velocity at an impact, as a share of its greatest speed in the motion."""
MIN_JUMP_BY_GRAVITY = 3.0
"""Least jump in units of gravity's change in a step: resting or rocking bodies have no impacts."""
IMPACT_OFFSET = 1e-6
"""Offset [steps] of an impact from the start of its step, so that a sample there is before it."""


def impact_times(velocity: Array, gravity: Array, dt: float) -> Array:
    """Return the times (i,) [s] of steps with an impact, of velocities (n, bodies, 3) [m/s] before n steps.

    An impact changes a velocity by more than gravity (3,) [m/s^2] and by another amount than the step before, so that
    motors and springs, which act over many steps, make none. The first step has none: nothing is before it.
    """
    change = np.diff(velocity, axis=0) - gravity * dt
    speed = np.max(np.linalg.norm(velocity, axis=2), axis=0, initial=0.0)
    least = np.maximum(MIN_JUMP_SHARE * speed, MIN_JUMP_BY_GRAVITY * float(np.linalg.norm(gravity)) * dt)
    jumps = np.linalg.norm(np.diff(change, axis=0, prepend=change[:1]), axis=2) > least
    struck = np.any(jumps & (np.linalg.norm(change, axis=2) > least) & (least > 0), axis=1)
    return np.asarray((np.flatnonzero(struck) + IMPACT_OFFSET) * dt, np.float64)
