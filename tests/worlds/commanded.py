"""An arm on a motor with known numbers, driven by recorded commands."""

from __future__ import annotations

from typing import Any

import numpy as np

import symphys
from symphys.types import Array

DT, NOISE, DURATION = 0.01, 0.002, 3.0
"""[s], [rad], [s]."""
RATES, ENDS = (50, 80), (3.0, 2.5)
"""[Hz] and [s] of each run."""
TRUTH = {"gain": 1.4, "delay": 0.023, "damping": 0.05, "friction": 0.12, "rotor": 0.015}
GUESS = {"gain": 1.0, "delay": 0.0, "damping": 0.02, "friction": 0.05, "rotor": 0.005}
SETS = {
    "gain": "knee.gain",
    "delay": "knee.command.delay",
    "damping": "knee.damping",
    "friction": "knee.friction",
    "rotor": "knee.armature",
}
VARIABLES = [{"name": name, "sets": sets} for name, sets in SETS.items()]
FINE = 200
"""Points in a step, of whose means the truth is made."""


def arm(numbers: dict[str, float]) -> dict[str, Any]:
    """A rod that hangs on a motor, 0.5 kg and 0.4 m."""
    rod = {"name": "rod", "shape": {"box": {"size": [0.05, 0.05, 0.4]}}, "mass": 0.5, "position": [0, 0, 0.8]}
    knee = {"name": "knee", "hinge": {"axis": [0, 1, 0]}, "between": ["world", "rod"], "point": [0, 0, 1]}
    knee |= {"motor": {"affine": {"gain": numbers["gain"]}}, "spring": {"damping": numbers["damping"]}}
    knee |= {"friction": numbers["friction"], "armature": numbers["rotor"]}
    return {"simulation": {"duration": DURATION, "dt": DT}, "body": [rod], "joint": [knee]}


def commands(run: int) -> tuple[Array, Array]:
    """Times (n,) [s] and commands (n,) of a run: a swing and steps."""
    time = np.arange(round(ENDS[run] * RATES[run]) + 1) / RATES[run]
    return time, 0.3 * np.sin((3 + 2 * run) * time + run) - 0.2 * np.sign(np.sin(7.1 * time + 1.3 * run))


def between(time: Array, values: Array, at: Array, interpolation: str) -> Array:
    """The command at other times."""
    if interpolation == "linear":
        return np.interp(at, time, values)
    return values[np.maximum(np.searchsorted(time, at, side="right") - 1, 0)]


def dense_means(time: Array, values: Array, steps: int, delay: float, interpolation: str) -> Array:
    """(steps,) means over the steps, from many points in each."""
    at = (np.arange(steps * FINE) + 0.5) * DT / FINE - delay
    return between(time, values, at, interpolation).reshape(steps, FINE).mean(axis=1)


def true_angles(run: int, interpolation: str) -> Array:
    """(n,) [rad] what the arm with the true numbers does, at the times of its commands."""
    steps = round(DURATION / DT)
    given = dense_means(*commands(run), steps, TRUTH["delay"], interpolation)
    command = {"name": "u", "sets": "knee.command", "knots": steps, "guess": given.tolist()}
    motion = symphys.simulate(symphys.load(arm(TRUTH) | {"variable": [command]}))
    return np.interp(commands(run)[0], motion.time, motion["knee.angle"].ravel())


def recorded_arm(interpolation: str, seed: int = 0, runs: int = 2, **others: Any) -> symphys.Problem:
    """The problem of two runs with noise in the angle; its guesses are not the truth."""
    random, recordings = np.random.default_rng(seed), []
    for run in range(runs):
        angle = true_angles(run, interpolation)
        angle = angle + NOISE * random.standard_normal(angle.shape)
        recordings.append(
            {
                "name": f"run{run}",
                "rate": float(RATES[run]),
                "table": {"u": commands(run)[1].tolist(), "angle": angle.tolist()},
                "measured": [{"value": "knee.angle", "columns": "angle", "noise": NOISE}],
                "inputs": {"knee.command": {"columns": "u", "interpolation": interpolation}},
            }
        )
    return symphys.load(arm(GUESS) | {"variable": VARIABLES, "recording": recordings} | others)
