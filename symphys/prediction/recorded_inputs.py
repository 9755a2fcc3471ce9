"""Recorded commands, forces and torques as inputs of the time steps, and their derivatives by a delay.

Inputs act over a whole step. That of step k is the mean of the recorded one over the step, so that its impulse is
exact, whatever the rates of samples and steps:

    u_k = 1 / dt * integral of s(t - delay) from t_k to t_k + dt
    d u_k / d delay = (s(t_k - delay) - s(t_k + dt - delay)) / dt

The derivative is exact for lines between samples and for samples that are held. Of the latter u_k has a kink where a
jump meets the end of a step; the derivative there is that towards later.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from symphys.problem import RecordedInput, Recording, Variable, VariableSlot
from symphys.transcription.randomization.sampler import hidden
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

    Args:
        recorded: with samples at times (k,) [s].
        steps: whose inputs are wanted.
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
