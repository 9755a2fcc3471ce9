"""The recorded bounces are the parabolas that the description names, with its noise, and the engine predicts them."""

from __future__ import annotations

import numpy as np
import pytest
from data.bouncing import bouncing_height

import symphys
from symphys import problems
from symphys.problem import load_problem

HEIGHTS, RADIUS, RESTITUTION, NOISE = (1.0, 0.7, 1.3), 0.05, 0.75, 0.002


def test_recordings_are_parabolas_with_noise() -> None:
    """The squared residuals of 167 samples, over the noise, are within three deviations of their number."""
    recordings = load_problem(problems.find("bounce_recorded")).recordings
    assert [each.held_back for each in recordings] == [False, False, True]
    residuals = []
    for each, height in zip(recordings, HEIGHTS, strict=True):
        (measured,) = each.measured
        truth = bouncing_height(each.time, height, RADIUS, RESTITUTION)
        residuals.append((measured.values[:, 0] - truth) / NOISE)
        assert measured.noise is not None and measured.noise.tolist() == [NOISE]
    known = np.concatenate(residuals)
    known = known[np.isfinite(known)]
    assert known.size == 167
    assert abs(known @ known - known.size) < 3 * np.sqrt(2 * known.size)


@pytest.mark.parametrize("drop", range(3))
def test_the_engine_predicts_them(drop: int) -> None:
    """With the true numbers, as the parabolas have it; with a restitution that is off by 0.05, not at all."""
    problem = load_problem(problems.find("bounce_recorded"))
    time = problem.recordings[drop].time
    steps = np.round(time / problem.simulation.dt).astype(int)
    errors = []
    for restitution in (RESTITUTION, RESTITUTION + 0.05):
        motion = symphys.simulate(problem, bounce=restitution, let_go=HEIGHTS[drop])
        simulated = motion["ball.position"][steps, 2]
        errors.append(np.abs(simulated - bouncing_height(time, HEIGHTS[drop], RADIUS, RESTITUTION)).max())
    assert errors[0] < NOISE / 10 < 10 * NOISE < errors[1]
