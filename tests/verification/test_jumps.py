"""A place that jumps is found though energy and momentum add up, and what moves as its velocities say is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tools.repeats import few

import symphys
from symphys.findings.examination import Examination
from symphys.findings.levels import BAD
from symphys.findings.physics import jump_findings
from symphys.transcription import Record, Transcription, transcribe
from symphys.verification.balance import jumps

Make = Callable[..., Transcription]
BOUNCE = """
[simulation]
duration = 0.6
dt = 0.01
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 0.5]
collides_with = ["ground"]
[[body]]
name = "wheel"
mass = 1.0
inertia = 0.01
position = [3, 0, 1]
angular_velocity = [0, 12, 0]
collides_with = []
[[joint]]
name = "axle"
between = ["world", "wheel"]
hinge = { axis = [0, 1, 0] }
point = [3, 0, 1]
[ground]
restitution = 0.8
[[variable]]
name = "v"
sets = "ball.velocity[0]"
guess = 1
[[target]]
name = "t"
value = "ball.position[0]"
tolerance = 0.1
"""


def recorded(make: Make) -> tuple[Any, Record]:
    made = make(BOUNCE)
    return made.rollout, made.record(made.shooting.start(0))


def changed(record: Record, **arrays: np.ndarray) -> Record:
    return replace(record, motion=replace(record.motion, **arrays))


def test_a_body_that_is_put_elsewhere_is_named_with_time_and_distance(make: Make) -> None:
    """By 5 cm after step 20: its radius of gyration is 6.3 cm, and a step at its speed takes it 2 cm."""
    rollout, record = recorded(make)
    assert jumps(rollout, record)["jump"] < 1e-9
    position = record.motion.position.copy()
    position[21:, 0, 0] += 0.05
    found = jumps(rollout, changed(record, position=position))
    assert found["jump_at"]["name"] == "ball" and found["jump_at"]["time"] == pytest.approx(0.2)
    assert 0.1 < found["jump"] < 0.8
    (line,) = jump_findings(Examination.from_json(found))
    assert line.level == BAD and '"ball" at t = 0.2 s jumps' in line.doubt


def test_an_angle_that_loses_a_turn_jumps(make: Make) -> None:
    rollout, record = recorded(make)
    value = record.motion.joint_value.copy()
    value[30:] -= 2 * np.pi
    found = jumps(rollout, changed(record, joint_value=value))
    assert found["jump"] > 1 and found["jump_at"]["name"] == "axle"


def screw(start: float, limits: tuple[float, float]) -> dict[str, Any]:
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


@few(("start", "limits", "size"), [(0.0, (-100, 100), 0.0), (0.0, (-1, 20), 0.0), (7.0, (-100, 100), 0.0557)], 1)
def test_a_carriage_that_begins_off_its_thread_jumps(start: float, limits: Any, size: float) -> None:
    made = transcribe(symphys.load(screw(start, limits)), backend="casadi")
    record = made.record(np.zeros(1))
    found = jumps(made.timed(record).rollout, record)
    lines = jump_findings(Examination.from_json(found))
    assert len(lines) == (size > 0)
    assert not size or (found["jump_at"]["name"] in ("guide", "carriage") and lines[0].level == BAD)
    assert not size or found["jump_at"]["size"] == pytest.approx(size, rel=0.1)


def test_what_does_not_jump_has_no_line() -> None:
    assert jump_findings(Examination()) == []
    assert jump_findings(Examination(jump=1e-3, jump_of="ball", jump_time=0.1, jump_size=1e-4)) == []
