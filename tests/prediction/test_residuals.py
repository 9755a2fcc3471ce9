"""Residuals of recordings of a tumbling crate: what they are, and their derivatives by everything identified."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from symphys.identification import IdentificationOptions, identify
from symphys.prediction import RecordingResiduals, residuals_of
from symphys.problem import load_problem, problem_of_tables
from symphys.problems import find
from symphys.transcription import transcribe

SETS = ("position", "orientation", "velocity", "angular_velocity")
SHORT = [0.0, 0.011, 0.045, 0.07]
"""[s] of a second recording, which ends in flight."""


def tables() -> dict[str, Any]:
    """A crate whose flight and impact two recordings have seen, with a clock and a scale that are off."""
    crate = {"name": "crate", "mass": 1, "shape": {"box": {"size": [0.2, 0.3, 0.25]}}, "friction": 0.5}
    start = {"position": [0, 0, 0.4], "velocity": [0.5, 0, -1], "angular_velocity": [2, 1, 0.5]}
    shared = [
        {"name": "grip", "sets": "crate.friction"},
        {"name": "size", "sets": "crate.size"},
        {"name": "clock", "sets": "toss.offset", "scale": 0.001, "upper": 0.01},
        {"name": "scale", "sets": "toss.scale", "guess": 1.01},
    ]
    own = [{"name": f"own_{each}", "sets": f"crate.{each}", "each": "recording"} for each in SETS[1:]]
    return {
        "simulation": {"duration": 0.3, "dt": 0.01},
        "body": [{**crate, **start}],
        "ground": {"friction": 1},
        "variable": [*shared, *own],
    }


def recorded(noise: Any = 0.001) -> dict[str, Any]:
    """With the numbers of a simulation, one of them missing."""
    plain = [{"name": "grip", "sets": "crate.friction"}]
    made = transcribe(problem_of_tables({**tables(), "variable": plain}), backend="casadi")
    motion = made.simulate(made.shooting.start(0))
    table: dict[str, list[float]] = {"toss": [], "time": [], **{name: [] for name in "xyzabcd"}}
    for toss, times in enumerate((np.linspace(0, 0.28, 15), SHORT)):
        for time in times:
            numbers = [np.interp(time, motion.time, column) for column in motion.position[:, 0].T]
            pose = [np.interp(time, motion.time, column) for column in motion.orientation[:, 0].T]
            row = [toss, time, *numbers, *(np.array(pose) / np.linalg.norm(pose))]
            for name, value in zip(table, row, strict=True):
                table[name].append(float(value))
    table["y"][3] = float("nan")
    table["c"][5] = float("nan")
    where = {"value": "crate.position", "columns": ["x", "y", "z"]}
    measured = [
        {**where, **({"noise": noise} if noise else {})},
        {"value": "crate.orientation", "columns": ["a", "b", "c", "d"], "noise": 0.01},
    ]
    start = {"crate.position": {"columns": ["x", "y", "z"]}, "crate.orientation": {"columns": ["a", "b", "c", "d"]}}
    return {
        **tables(),
        "recording": [
            {"name": "toss", "split": "toss", "table": table, "measured": measured, "start": start, "weight": 4}
        ],
    }


@pytest.fixture(scope="module")
def residuals() -> RecordingResiduals:
    return residuals_of(problem_of_tables(recorded()), threads=1)


def moved(residuals: RecordingResiduals) -> tuple[np.ndarray, np.ndarray]:
    """Numbers near the guess."""
    rng = np.random.default_rng(0)
    shared, own = residuals.shared, residuals.own
    clock = shared.names.index("clock")
    found = shared.guess + 0.02 * shared.scale * rng.normal(size=shared.guess.shape)
    found[clock] = 0.0013
    return found, own.guess + 0.02 * own.scale * rng.normal(size=own.guess.shape)


@pytest.mark.slow
def test_missing_samples_are_left_out_and_orientations_have_three_residuals(residuals: RecordingResiduals) -> None:
    rows = residuals.rows(0)
    assert len(rows.time) == 15 * 6 - 1 - 3
    assert residuals.quantities == ("crate.position", "crate.orientation")
    assert residuals.units == ("m", "rad")
    found = residuals.residuals(residuals.shared.guess, residuals.own.guess, np.array([0, 1]))
    assert [len(each) for each in found] == [len(residuals.rows(k).time) for k in range(2)]
    exact = residuals.shared.guess.copy()
    exact[residuals.shared.names.index("scale")] = 1.0
    again = residuals.residuals(exact, residuals.own.guess, np.array([0]))[0]
    flight = residuals.rows(0).time < 0.05
    assert np.abs(again[flight]).max() < 0.02, "the simulation that was recorded"


@pytest.mark.thorough
def test_derivatives_are_those_of_differences(residuals: RecordingResiduals) -> None:
    shared, own = moved(residuals)
    which, h = np.array([0, 1]), 1e-5
    found = residuals.jacobian(shared, own, which)
    values = residuals.residuals(shared, own, which)
    for k, (value, by_shared, by_own) in enumerate(found):
        np.testing.assert_array_equal(value, values[k])
        for j in range(by_shared.shape[1]):
            step = h * np.eye(len(shared))[j]
            ends = [residuals.residuals(shared + sign * step, own, which)[k] for sign in (1, -1)]
            expected = (ends[0] - ends[1]) / (2 * h)
            assert by_shared[:, j] == pytest.approx(expected, rel=1e-5, abs=0.01), j
        for j in range(by_own.shape[1]):
            step = np.zeros_like(own)
            step[k, j] = h
            ends = [residuals.residuals(shared, own + sign * step, which)[k] for sign in (1, -1)]
            expected = (ends[0] - ends[1]) / (2 * h)
            assert by_own[:, j] == pytest.approx(expected, rel=1e-5, abs=0.01), j


@pytest.mark.slow
def test_noise_that_is_not_given_begins_as_a_share_of_the_spread() -> None:
    problem = problem_of_tables(recorded(noise=None))
    found = residuals_of(problem, threads=1)
    assert found.noise_known.tolist() == [False, True]
    values = np.concatenate([recording.measured[0].values for recording in problem.recordings])
    assert found.noise[0] == pytest.approx(0.01 * np.nanstd(values, axis=0))


def test_the_restitution_of_the_shipped_drops_is_found() -> None:
    found = identify(residuals_of(load_problem(find("bounce_recorded")), threads=1), IdentificationOptions(draws=0))
    (bounce,) = found.parameters
    assert bounce.lower < 0.75 < bounce.upper
    assert bounce.upper - bounce.lower < 0.002
    assert found.own[:2, 0] == pytest.approx([1.0, 0.7], abs=0.002)
