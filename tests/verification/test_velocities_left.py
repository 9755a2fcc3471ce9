"""Velocities that sweeps leave are as large as settled sweeps say, and no motion with much of that is solved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symphys.findings.levels import Judged
from symphys.findings.verdict import DOUBTED, SOLVED, judge_run
from symphys.transcription import Transcription, transcribe
from symphys.verification import survey
from symphys.verification.bodies import bodies
from symphys.verification.refinement import speeds

MET = Judged(1.0, 0.5, True, True, 1.0)

CRATE = """
[simulation]
duration = 0.5
dt = 0.01
newton_start = false
[[body]]
name = "crate"
shape = { box = { size = [1, 1, 1] } }
mass = 1.0
position = [0, 0, 1.5]
[[block]]
name = "pedestal"
shape = { box = { size = [0.2, 0.2, 0.5] } }
position = [0, 0, -0.25]
[contact]
restitution = 1.0
friction = 0.4
[[variable]]
name = "height"
sets = "crate.position[2]"
guess = 1.5
[[cost]]
name = "up"
value = "crate.position[2]"
"""
"""It lands flat on a pedestal of a fifth of its width after 0.45 s, and should bounce without a turn."""
OFF_CENTRE = CRATE.replace("position = [0, 0, -0.25]", "position = [0.05, 0.02, -0.25]")
HALF = CRATE.replace("restitution = 1.0", "restitution = 0.5")


def missed(few: Transcription) -> float:
    """[m/s] The largest error of a velocity after one step from a state of the motion, as 60 sweeps find it."""
    record, rollout = few.record(few.shooting.start(0)), few.rollout
    simulation = replace(few.problem.simulation, sweeps=60)
    settled = transcribe(replace(few.problem, simulation=simulation), backend="casadi")
    x, u, p = record.arrays.x, record.arrays.u, np.tile(record.arrays.p[:, None], rollout.steps)
    after = np.array(settled.rollout.step.map(rollout.steps)(x[:-1].T, u.T, p, 0.0)).T
    return float(speeds(rollout, bodies(rollout, record), after - x[1:]).max())


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("text", "sweeps"),
    [
        pytest.param(CRATE, 10, id="crate"),
        pytest.param(CRATE, 15, id="15 sweeps", marks=pytest.mark.thorough),
        pytest.param(OFF_CENTRE, 10, id="off centre", marks=pytest.mark.thorough),
        pytest.param(HALF, 10, id="rebounds by half", marks=pytest.mark.thorough),
    ],
)
def test_what_is_left_is_what_settled_sweeps_find_and_is_not_solved(make, text, sweeps):
    """The residual is below 5 % of the largest impulse in each."""
    few = make(text, simulation__sweeps=sweeps)
    found = survey(few, few.record(few.shooting.start(0)))
    assert found["residual"] < 0.05 * found["impulse"]
    assert found["left_at"]["speed"] == pytest.approx(missed(few), rel=0.3)
    assert found["left"] > 0.01
    found_verdict = judge_run("met", MET, found)
    assert found_verdict.word == DOUBTED and "more `sweeps` find its velocity" in " ".join(found_verdict.doubts)


@pytest.mark.slow
def test_what_has_settled_is_solved(make):
    """As a file is that does not switch Newton's method off."""
    crate = make(CRATE, simulation__newton_start=True)
    found = survey(crate, crate.record(crate.shooting.start(0)))
    assert found.get("left", 0.0) < 1e-3
    assert judge_run("met", MET, found).word == SOLVED
