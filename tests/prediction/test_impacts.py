"""Impacts of a simulation: when they are, what is missing after them, and starts from before the first."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import symphys
from symphys.prediction import residuals_of
from symphys.prediction.predictor import impact_times
from symphys.results.identification import Identification

GRAVITY, NOISE = np.array([0.0, 0.0, -9.81]), 0.001
HEIGHTS = (0.3, 0.5, 0.45, 0.6)
"""[m] from which balls of 0.05 m are dropped."""


def test_jumps_are_impacts_and_motors_and_rest_are_none() -> None:
    time, dt = np.arange(0, 1, 0.01), 0.01
    fall = np.where(time < 0.5, GRAVITY[2] * time, 3.0 + GRAVITY[2] * (time - 0.5))
    velocity = np.zeros((len(time), 2, 3))
    velocity[:, 0, 2] = fall
    velocity[:, 1, 0] = np.clip(20 * (time - 0.2), 0, 4)  # a motor pulls, the ground carries
    assert impact_times(velocity, GRAVITY, dt) == pytest.approx([0.49], abs=1e-6)
    assert impact_times(velocity[:, 1:], GRAVITY, dt).size == 0
    assert impact_times(np.zeros((5, 1, 3)), np.zeros(3), dt).size == 0


def dropped(height: float) -> dict[str, Any]:
    ball = {"name": "ball", "shape": {"sphere": {"radius": 0.05}}, "mass": 0.2, "position": [0, 0, height]}
    simulation = {"duration": 0.9, "dt": 0.01}
    return {"simulation": simulation, "body": [ball], "ground": {"friction": 0.3, "restitution": 0.7}}


def problem(ringing: float = 0.0, held_back: bool = False, clock: float = 0.0) -> symphys.Problem:
    """Drops whose heights and restitution are fitted; the measured ball rings after each impact [m].

    What is held back was measured with another restitution, and its height begins 2 cm off.
    """
    random, recordings = np.random.default_rng(1), []
    for k, height in enumerate(HEIGHTS):
        tables, last = dropped(height), held_back and k == len(HEIGHTS) - 1
        tables["ground"]["restitution"] = 0.5 if last else 0.7
        motion = symphys.simulate(symphys.load(tables))
        z = motion["ball.position"][:-1, 2] + NOISE * random.standard_normal(len(motion.time) - 1)
        first = np.sqrt(2 * (height - 0.05) / 9.81)
        z += np.where(motion.time[:-1] > first, ringing * np.exp(-(motion.time[:-1] - first) / 0.1), 0.0)
        start = [[0, 0, height - 0.02 * last]] * len(z)
        table = {"z": z.tolist(), "p": start}
        measured = [{"value": "ball.position[2]", "columns": "z", "noise": NOISE}]
        drop = {"name": f"drop{k}", "rate": 100, "table": table, "measured": measured, "held_back": last}
        recordings.append(drop | {"start": {"ball.position": "p"}})
    variables = [
        {"name": "bounce", "sets": "ground.restitution", "guess": 0.6, "lower": 0.0, "upper": 0.98},
        {"name": "height", "sets": "ball.position[2]", "each": "recording", "guess": 0.4},
    ]
    if clock:
        variables.append({"name": "clock", "sets": "drop0.offset", "guess": clock, "scale": 0.001})
    return symphys.load(dropped(0.4) | {"variable": variables, "recording": recordings})


@pytest.mark.slow
def test_rows_have_the_time_since_the_impacts_of_the_simulation() -> None:
    found = symphys.identify(problem(), threads=1)
    assert found["bounce"].lower < 0.7 < found["bounce"].upper
    first = np.sqrt(2 * (HEIGHTS[0] - 0.05) / 9.81)
    time, since = (each[found.residual_recording == 0] for each in (found.residual_time, found.residual_impact))
    assert np.isnan(since[time < first - 0.01]).all() and np.isfinite(since[time > first + 0.01]).all()
    second = first * (1 + 2 * 0.7)
    flight = (time > first + 0.01) & (time < second - 0.02)
    assert since[flight] == pytest.approx(time[flight] - first, abs=0.01)
    after = (time > second + 0.02) & (time < first * (1 + 2 * 0.7 + 2 * 0.49) - 0.02)
    assert after.sum() > 10
    assert since[after] == pytest.approx(time[after] - second, abs=0.02)
    assert found.quantities[0].verdict == "noise"


@pytest.mark.slow
def test_impacts_are_on_the_clock_of_the_recording() -> None:
    """That began 0.05 s after the simulation: its first sample is then."""
    residuals = residuals_of(problem(clock=0.05), threads=1)
    (late,) = residuals.simulated_impacts(residuals.shared.guess, residuals.own.guess, np.array([0]))
    first = np.sqrt(2 * (HEIGHTS[0] - 0.05) / 9.81)
    assert late[0] == pytest.approx(np.floor(first * 100) / 100 - 0.05, abs=1e-6)


@pytest.mark.slow
def test_what_rings_after_impacts_is_missing_after_impacts() -> None:
    """By the time since the impact, which differs from drop to drop."""
    found = symphys.identify(problem(ringing=0.01), threads=1)
    (left,) = found.quantities
    assert left.verdict == "missing effect" and "depends on the time since the impact" in left.text
    assert left.by_impact > 0.1


def held(starts: str) -> Identification:
    return symphys.identify(problem(held_back=True), threads=1, held_back_starts=starts)


@pytest.mark.slow
def test_starts_of_what_is_held_back_come_from_where_the_setting_says() -> None:
    heights = {starts: held(starts).own[-1, 0] for starts in ("guess", "before impact", "whole")}
    assert heights["guess"] == pytest.approx(HEIGHTS[-1] - 0.02)
    assert heights["before impact"] == pytest.approx(HEIGHTS[-1], abs=0.001)
    assert abs(heights["whole"] - HEIGHTS[-1]) > 0.003, "the other restitution bends it"


@pytest.mark.slow
def test_settings_are_checked() -> None:
    tables = problem()
    with pytest.raises(symphys.SymphysError, match=r"above 0 .*1"):
        symphys.load(dropped(0.4) | {"identify": {"horizons": [0.5, 0.3]}})
    with pytest.raises(symphys.SymphysError, match="held_back_starts"):
        symphys.identify(tables, threads=1, held_back_starts="after impact")
    with pytest.raises(symphys.SymphysError, match=r"'hubber'.*huber"):
        symphys.identify(tables, threads=1, loss="hubber")
    grown = symphys.identify(tables, threads=1, horizons=[0.5, 1])
    assert grown["bounce"].value == pytest.approx(0.7, abs=0.005)
    assert len(np.unique(grown.history[:, 1])) > 3
