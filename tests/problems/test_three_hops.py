"""Three hops of a leg on a spring, by commands alone."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from data.shipped import Array, seeds, shipped, solve

from symphys import problems
from symphys.problem import load_problem
from symphys.trajectory import Trajectory
from symphys.transcription import transcribe
from symphys.verification.refinement import FINER_DT, finer_problem

GRAVITY, RADIUS, STEP, KNOTS = 9.81, 0.04, 0.005, 41
MASSES = {"torso": 5.0, "leg": 0.3, "foot": 0.4}
DEPARTURES = (0.05, 0.65, 1.25)


def flights(motion: Trajectory) -> list[tuple[int, int]]:
    """The numbers of the states between which there is no contact for 0.15 s at least, of flights that have ended."""
    touches = np.flatnonzero(motion["foot-ground.force"][:, 2] > 0)
    return [(int(a), int(b)) for a, b in pairwise(touches) if motion.time[b] - motion.time[a] >= 0.15]


def test_with_its_leg_straight_down_the_guess_hops_on_the_spot() -> None:
    """Nothing pushes it aside, and in its three flights the centre of mass falls freely: thrust is an inner force."""
    made = shipped("three_hops")
    thrust = made.shooting.start(0)[:KNOTS]
    motion = made.simulate(np.concatenate([thrust, np.zeros(KNOTS)]))
    found = flights(motion)
    assert len(found) == 3
    rising: Array = sum(mass * motion[f"{name}.velocity"][:, 2] for name, mass in MASSES.items()) / sum(MASSES.values())
    for first, last in found:
        aloft = slice(first + 2, last - 2)
        assert np.diff(rising[aloft]) == pytest.approx(-GRAVITY * STEP, rel=1e-6)
    assert np.abs(motion["foot.position"][:, 0]).max() < 1e-9


@seeds(3)
def test_three_hops_in_a_row(seed: int) -> None:
    """Three flights, a foot that is where it should land and stands, and the same at half the time step."""
    made = shipped("three_hops")
    found = solve("ipopt", made, seed)
    motion = made.simulate(found.z)
    assert made.judge(found.z).solved
    assert len(flights(motion)) == 3
    foot = motion["foot.position"]
    for k, (leaves, lands) in enumerate(zip(DEPARTURES, (0.6, 1.2, 2.0), strict=True)):
        aloft = (motion.time > leaves) & (motion.time < lands)
        assert foot[aloft, 2].max() - RADIUS > 0.07
        at = int(np.argmin(np.abs(motion.time - lands)))
        assert foot[at] == pytest.approx([0.3 * (k + 1), 0, RADIUS], abs=0.03)
        assert foot[at - 10] == pytest.approx(foot[at], abs=2e-3)  # it rolls a little
    assert finer_problem(made, FINER_DT).judge(found.z).worst < 1


def test_another_start_is_forgotten() -> None:
    """Of 0.3 m/s at the start, with the same commands, less than a twentieth is left after three hops."""
    made = shipped("three_hops")
    z = made.shooting.start(0)
    pushed = load_problem(problems.find("three_hops"), {f"body.{k}.velocity": [0.3, 0, 0] for k in range(4)})
    still, moving = made.simulate(z), transcribe(pushed, backend="casadi").simulate(z)
    assert moving["torso.velocity"][0, 0] == pytest.approx(0.3)
    assert moving["torso.velocity"][-1, 0] == pytest.approx(still["torso.velocity"][-1, 0], abs=0.015)
