"""Starts of jointed bodies: what a recording gives of one body and of joints, all bodies fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.recorded import beside

from symphys.problem import Problem
from symphys.problem.start import StartValues

BOX = {"shape": {"box": {"size": [0.1, 0.05, 0.05]}}, "mass": 0.3}
CHAIN: dict[str, Any] = {
    "body": [
        {"name": "one", **BOX, "position": [0, 0, 1]},
        {"name": "two", **BOX, "position": [0.12, 0, 1]},
        {"name": "three", **BOX, "position": [0.24, 0, 1]},
    ],
    "joint": [
        {"name": "elbow", "hinge": {"axis": [0, 1, 0]}, "between": ["one", "two"], "point": [0.06, 0.01, 1]},
        {"name": "slide", "slider": {"axis": [1, 0, 0]}, "between": ["two", "three"], "point": [0.18, 0, 1]},
    ],
    "variable": [{"name": "bounce", "sets": "ground.restitution"}],
}
POSE = {
    "position": [0.3, -0.2, 1.4],
    "orientation": [0.5, 0.5, -0.5, 0.5],
    "velocity": [1.0, 2.0, -0.5],
    "angular_velocity": [0.4, -3.0, 2.0],
}


def start_of(problem: Problem) -> dict[str, Any]:
    """What formulas name of the start of the first recording: of joints too, with their separations and tilts."""
    values = {**problem.initial, **problem.parameters, **problem.recordings[0].start}
    start = StartValues().of(problem.parametric, values)
    apart = {f"apart {k}": reading[:2] for k, reading in enumerate(start.joints())}
    found = {name: value() if callable(value) else value for name, value in start.quantities().items()}
    return {name: np.array(value).ravel() for name, value in found.items()} | apart


def recorded(folder: Path, given: dict[str, Any], start: dict[str, str], **tables: Any) -> Problem:
    """A chain whose recording has these numbers in both rows."""
    np.savez(folder / "a.npz", time=[0, 0.1], **{key: np.array([value, value]) for key, value in given.items()})
    measured = [{"value": "three.position[2]", "columns": "time"}]
    return beside(folder, {"files": "a.npz", "measured": measured, "start": start}, **{**CHAIN, **tables})


@pytest.mark.slow
@pytest.mark.parametrize("body", ["one", "two", "three"])
def test_joints_carry_the_others(body: str, tmp_path: Path) -> None:
    """Whichever body is given: joints hold together, have the coordinates and rates that are given, and no others."""
    given = {**POSE, "bend": 0.7, "spin": -4.0, "out": 0.02, "speed": 0.3}
    start = {f"{body}.{field}": field for field in POSE}
    start |= {"elbow.angle": "bend", "elbow.rate": "spin", "slide.position": "out", "slide.rate": "speed"}
    problem = recorded(tmp_path, given, start)
    found = start_of(problem)
    for name, value in {"elbow.angle": 0.7, "elbow.rate": -4.0, "slide.position": 0.02, "slide.rate": 0.3}.items():
        assert found[name][0] == pytest.approx(value, abs=1e-12)
    assert max(found["apart 0"] + found["apart 1"]) < 1e-12
    own = problem.recordings[0].start
    assert len(own) == 13
    assert own["elbow.unwrapped"] == [0.7]
    for field, value in POSE.items():
        np.testing.assert_allclose(own[f"{body}.{field}"], value, atol=1e-15)


@pytest.mark.slow
def test_velocities_are_those_of_the_moving_joint(tmp_path: Path) -> None:
    """The difference of two starts, a moment apart, is the velocity of the third body: its own law of motion."""
    moment = 1e-6
    later = {"bend": 0.7 - 4.0 * moment, "out": 0.02 + 0.3 * moment}
    start = {"elbow.angle": "bend", "elbow.rate": "spin", "slide.position": "out", "slide.rate": "speed"}
    rates = {"spin": -4.0, "speed": 0.3}
    fixed = {"hinge": {"axis": [0, 0, 1]}, "between": ["world", "one"], "point": [0, 0, 1], "name": "base"}
    joints = {"joint": [fixed, *CHAIN["joint"]]}
    a, b = (
        recorded(tmp_path, {**rates, **angles}, start, **joints).recordings[0].start
        for angles in ({"bend": 0.7, "out": 0.02}, later)
    )
    speed = (b["three.position"] - a["three.position"]) / moment
    np.testing.assert_allclose(speed, a["three.velocity"], atol=1e-5)
    assert np.linalg.norm(speed) > 0.3


def test_bodies_without_joints_are_set_alone(tmp_path: Path) -> None:
    problem = recorded(tmp_path, {"p": [0, 0, 2]}, {"one.position": "p"}, joint=[])
    assert set(problem.recordings[0].start) == {"one.position"}
