"""Examinations see a joint that is put elsewhere, and none where joints move as fast as they say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import symphys
from symphys.findings.energy import jump_findings
from symphys.findings.examination import Examination
from symphys.findings.levels import BAD
from symphys.transcription import transcribe
from symphys.verification.jumps import jumps


def screw(start: float, limits: tuple[float, float] = (-100.0, 100.0)) -> dict[str, Any]:
    """A carriage that follows a spindle of 50 mm a turn, from 0; the spindle comes to its limits at speed."""
    still = {"shape": {"sphere": {"radius": 0.1}}, "mass": 1.0, "collides_with": []}
    hinge = {"hinge": {"axis": [1, 0, 0]}, "point": [0, 0, 0], "start": start, "limits": list(limits)}
    return {
        "simulation": {"duration": 1.0, "dt": 0.01},
        "world": {"gravity": [0, 0, 0]},
        "body": [
            {"name": "bed", **still},
            {"name": "spindle", **still, "angular_velocity": [60, 0, 0]},
            {"name": "carriage", **still},
        ],
        "joint": [
            {"name": "stand", "between": ["world", "bed"], "fixed": {}, "point": [0, 0, 0]},
            {"name": "axle", "between": ["bed", "spindle"], **hinge},
            {"name": "guide", "between": ["bed", "carriage"], "slider": {"axis": [1, 0, 0]}},
        ],
        "coupling": [{"name": "thread", "joints": ["guide", "axle"], "polynomial": [0.0, 0.05 / (2 * np.pi)]}],
        "variable": [{"name": "more", "sets": "axle.start_rate", "guess": 0.0}],
        "cost": [{"name": "way", "value": "guide.position ** 2"}],
    }


@pytest.mark.parametrize(
    ("start", "limits", "jumps_by"), [(0.0, (-100, 100), 0.0), (0.0, (-1, 20), 0.0), (7.0, (-100, 100), 0.0557)]
)
def test_a_carriage_that_begins_off_its_thread_jumps(start: float, limits: Any, jumps_by: float) -> None:
    made = transcribe(symphys.load(screw(start, limits)), backend="casadi")
    record = made.record(np.zeros(1))
    found = Examination.from_json(jumps(made.timed(record).rollout, record))
    lines = jump_findings(found)
    if not jumps_by:
        assert found.jump < 0.05
        assert not lines
        return
    assert lines[0].level == BAD
    assert abs(found.jump_moved) == pytest.approx(jumps_by, rel=0.1)
    assert lines[0].doubt.startswith("guide moves by 0.06 m in the step from t = 0 s")
