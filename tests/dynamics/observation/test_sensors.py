"""Kinds of sensors: each is declared once, and what documents, units and recordings say follows from that."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import symphys
from symphys.dynamics.observation import SENSOR_KINDS, SensorKind
from symphys.problem.recordings.conversion import TURNED

FORMULAS = Path(__file__).parents[3] / "docs" / "formulas.md"


def row(kind: SensorKind) -> str:
    """The line that a kind has in docs/formulas.md."""
    owner = {"body": "torso", "joint": "rail" if kind.key == "position" else "knee", "site": "tip"}[kind.owner]
    unit = f"{kind.unit}, or {kind.sliding_unit}" if kind.sliding_unit is not None else kind.unit or "-"
    return f"| `{owner}.{kind.key}` | {kind.size or 'k'} | {unit} | {kind.about} |\n"


@pytest.mark.parametrize("kind", SENSOR_KINDS, ids=lambda kind: f"{kind.owner}.{kind.key}")
def test_the_document_has_every_kind(kind: SensorKind) -> None:
    assert row(kind) in FORMULAS.read_text(encoding="utf-8"), "put this in:\n" + row(kind)


def test_names_are_unique_and_frames_turn_what_is_in_world_axes() -> None:
    """A frame of a measurement system turns vectors by the last part of their names, so that one part has one frame."""
    names = [(kind.owner, kind.key) for kind in SENSOR_KINDS]
    assert len(set(names)) == len(names)
    own = {kind.key for kind in SENSOR_KINDS if kind.axes == "own"}
    assert "gyro" in own and not own & TURNED
    assert {"velocity", "angular_velocity", "contact_force", "force", "torque"} <= TURNED


def test_quantities_over_time_may_remember_the_step_before() -> None:
    """An accelerometer that nothing in the file asks for: the change of velocity over each step, less gravity."""
    body = {"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 0.5, "position": [0, 0, 5]}
    drag = {"name": "drag", "on": "ball.force", "value": "-0.3 * ball.velocity"}
    tables = {
        "simulation": {"duration": 0.1, "dt": 0.01},
        "body": [body],
        "force": [drag],
        "variable": [{"name": "throw", "sets": "ball.velocity", "guess": [3, 1, 2]}],
        "cost": [{"name": "low", "value": "ball.position[2]"}],
    }
    start = np.array([3.0, 1.0, 2.0])
    _, found = symphys.compile(tables).recording("ball.accelerometer", "ball.velocity").forward(start[None])
    velocities = np.vstack([start, found["ball.velocity"][0]])
    felt = np.diff(velocities, axis=0) / 0.01 + [0, 0, 9.81]
    assert found["ball.accelerometer"][0] == pytest.approx(felt, abs=1e-9)
    assert np.linalg.norm(felt[0]) > 1
