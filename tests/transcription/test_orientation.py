"""A varied orientation: four numbers of which only the direction counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from symphys.problem import load_problem
from symphys.transcription import Transcription, transcribe

DUMBBELL = """
[simulation]
duration = 0.5
dt = 0.01

[[body]]
name = "dumbbell"
mass = 1.0
position = [0, 0, 0.5]
angular_velocity = [1, 2, 3]
shape = {{ spheres = [{{ radius = 0.1, centre = [-0.2, 0, 0] }}, {{ radius = 0.1, centre = [0.2, 0, 0] }}] }}

[ground]
friction = 0.5

[[variable]]
name = "held"
sets = "dumbbell.orientation{part}"
guess = {guess}

[[target]]
name = "where it lies"
value = "[dumbbell.position, rotate(dumbbell.orientation, [1, 0, 0]) - [0, 1, 0]]"
tolerance = 0.01
"""
Q = np.array([0.9, 0.2, -0.3, 0.4])


def held(folder: Path, part: str = "", guess: str = "[1, 0, 0, 0]") -> Transcription:
    path = folder / "dumbbell.toml"
    path.write_text(DUMBBELL.format(part=part, guess=guess), encoding="utf-8")
    return transcribe(load_problem(path), backend="casadi")


@pytest.mark.slow
@pytest.mark.parametrize("length", [0.5, 1.0, 3.0])
def test_the_length_plays_no_part(tmp_path: Path, length: float) -> None:
    dumbbell = held(tmp_path)
    unit = Q / np.linalg.norm(Q)
    one, other = (dumbbell.functions.gradient(z, 0) for z in (unit, length * unit))
    assert float(other[0]) == pytest.approx(float(one[0]), rel=1e-9)
    slope = np.array(other[3]).ravel()
    assert slope @ unit == pytest.approx(0, abs=1e-9 * np.linalg.norm(slope))
    assert slope * length == pytest.approx(np.array(one[3]).ravel(), rel=1e-6)
    motion = dumbbell.simulate(length * unit).arrays()["orientation"][:, 0]
    assert motion[0] == pytest.approx(unit)
    assert np.linalg.norm(motion, axis=1) == pytest.approx(1)


def differences(dumbbell: Transcription, z: np.ndarray) -> list[float]:
    """The slope of the merit by central differences."""
    steps = 1e-6 * np.eye(z.size)
    high, low = ([float(dumbbell.functions.value(z + sign * step, 0)[0]) for step in steps] for sign in (1, -1))
    return [(a - b) / 2e-6 for a, b in zip(high, low, strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize("length", [1.0, 2.0])
def test_the_gradient_is_right(tmp_path: Path, length: float) -> None:
    dumbbell, z = held(tmp_path), length * Q
    slope = np.array(dumbbell.functions.gradient(z, 0)[3]).ravel()
    assert np.linalg.norm(slope) > 0.1
    assert slope == pytest.approx(differences(dumbbell, z), rel=1e-5, abs=1e-6)


@pytest.mark.slow
def test_one_component_that_varies_leaves_a_unit_quaternion(tmp_path: Path) -> None:
    dumbbell, z = held(tmp_path, "[1]", "0.0"), np.array([0.7])
    first = dumbbell.simulate(z).arrays()["orientation"][0, 0]
    assert first == pytest.approx(np.array([1, 0.7, 0, 0]) / np.hypot(1, 0.7))
    slope = np.array(dumbbell.functions.gradient(z, 0)[3]).ravel()
    assert slope == pytest.approx(differences(dumbbell, z), rel=1e-5, abs=1e-6)
