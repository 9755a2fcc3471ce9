"""A place that jumps is found though energy and momentum add up, and what moves as its velocities say is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from symphys.findings.energy import jump_findings
from symphys.findings.examination import Examination
from symphys.findings.levels import BAD
from symphys.transcription import Record, Transcription
from symphys.verification.jumps import jumps

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
SPRING
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


def recorded(make: Make, spring: str = "") -> tuple[Any, Record]:
    made = make(BOUNCE.replace("SPRING", spring))
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


@pytest.mark.parametrize("spring", ["", "spring = { stiffness = 0.01, damping = 0 }"])
def test_a_turn_that_is_cut_counts_where_a_spring_acts_on_the_angle(make: Make, spring: str) -> None:
    """Else an angle less a whole turn is the same place."""
    rollout, record = recorded(make, spring)
    value = record.motion.joint_value.copy()
    value[:, 0, 0] = np.cumsum(np.concatenate([[0.0], record.motion.joint_rate[1:, 0, 0] * 0.01]))
    wound = changed(record, joint_value=value)
    assert jumps(rollout, wound)["jump"] < 1e-9
    value = value.copy()
    value[30:] -= 2 * np.pi
    found = jumps(rollout, changed(record, joint_value=value))
    assert (found["jump"] > 1) == bool(spring)
    assert not spring or found["jump_at"]["name"] == "axle"


def test_what_does_not_jump_has_no_line() -> None:
    assert jump_findings(Examination()) == []
    assert jump_findings(Examination(jump=1e-3, jump_of="ball", jump_time=0.1, jump_size=1e-4)) == []
