"""The benchmark of recorded tosses: on tosses of the engine itself, and on the recorded ones where they are at hand."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from tosses import FITTED, GRAVITY, RATE, TRUE, Simulator, Tosses, clearance, flights, fly, read, simulated, starts

RECORDED = os.environ.get("SYMPHYS_TOSSES", "")
recorded = pytest.mark.skipif(
    not RECORDED, reason="SYMPHYS_TOSSES names no folder with cube_fit.npz and cube_check.npz"
)


@pytest.fixture(scope="module")
def tosses(tmp_path_factory: pytest.TempPathFactory) -> Tosses:
    return simulated(3, tmp_path_factory.mktemp("tosses"))


@pytest.mark.slow
def test_the_numbers_of_the_truth_leave_no_error(tosses: Tosses, tmp_path: Path) -> None:
    made = Simulator(tosses, tmp_path / "tosses.npz", tosses.first())
    assert made.errors(TRUE).max() < 1e-4
    assert made.errors({**TRUE, "friction": 0.3}).mean(axis=0).min() > 1


@pytest.mark.slow
def test_flights_end_before_impacts(tosses: Tosses) -> None:
    frames, height = flights(tosses), clearance(tosses)
    for k, count in enumerate(frames):
        falling = tosses.columns["position"][tosses.rows(k)][:count, 2]
        assert np.abs(np.diff(falling, 3)).max() < 1e-4, "a parabola, but for the swing of the middle"
        assert height[tosses.rows(k)][count:].min() < 0.02


@pytest.mark.slow
def test_flights_tell_gravity_centre_of_mass_and_starts(tosses: Tosses, tmp_path: Path) -> None:
    found = fly([tosses], tmp_path / "flights.npz")
    assert found["g"].value == pytest.approx(-GRAVITY, rel=1e-4)
    com = [found[f"com[{k}]"].value for k in range(3)]
    assert com == pytest.approx([TRUE[f"com{k}"] for k in range(3)], abs=1e-5)
    (first,) = starts([tosses], found)
    assert first["velocity"] == pytest.approx(tosses.first()["velocity"], abs=1e-3)


@recorded
def test_recorded_cubes_are_predicted(tmp_path: Path) -> None:
    """Within the bars of the benchmark, which are ahead of the published 13.5 % and 16.5 degrees."""
    check = read(Path(RECORDED), "check")
    made = Simulator(check, tmp_path / "check.npz", check.first())
    position, rotation = made.errors(FITTED).mean(axis=0)
    assert position < 10
    assert rotation < 13
    assert RATE == 148
