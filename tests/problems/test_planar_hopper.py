"""A planar hopper, held up by springs, hops half a metre ahead."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, solve

from symphys.trajectory import Trajectory

MASSES = {"torso": 1.0, "leg": 0.2, "foot": 0.1}
GRAVITY = 9.81
SOLES = [0.1, -0.1]
"""Of the foot's two spheres along it, from its centre of mass [m]."""


def height(motion: Trajectory) -> np.ndarray:
    """(K,) of the centre of mass [m]."""
    moments = sum(mass * motion[f"{name}.position"][:, 2] for name, mass in MASSES.items())
    return np.asarray(moments / sum(MASSES.values()))


def clearance(motion: Trajectory) -> np.ndarray:
    """(K,) of the lower of the foot's spheres above the ground [m]; the foot's angle is the sum of the joints'."""
    angle = sum(motion[f"{name}.angle"].ravel() for name in ("pitch", "knee", "ankle"))
    ends = [motion["foot.position"][:, 2] + along * np.sin(angle) for along in SOLES]
    return np.asarray(np.min(ends, axis=0) - 0.03)


def test_springs_hold_it_up_in_the_guess() -> None:
    """It stays within 3 cm of its pose, on its foot, and the ground carries its weight."""
    made = shipped("planar_hopper", "casadi")
    motion = made.simulate(made.shooting.start(0))
    assert np.abs(motion["torso.position"][:, [0, 2]] - motion["torso.position"][0, [0, 2]]).max() < 0.03
    assert np.abs(clearance(motion)).max() < 2e-3
    carried = motion.contact_force[-1].sum(axis=0)
    np.testing.assert_allclose(carried, [0, 0, sum(MASSES.values()) * GRAVITY], atol=0.05)


@pytest.mark.thorough
def test_it_hops_half_a_metre() -> None:
    """From one of three seeds, as rounding has it: to its place, with a flight that is one of Galilei's parabolas."""
    made = shipped("planar_hopper")
    found = (solve("ilqr", made, seed) for seed in range(3))
    z = next(outcome.z for outcome in found if made.judge(outcome.z).solved)
    motion = made.simulate(z)
    assert motion["torso.position"][-1, 0] == pytest.approx(0.5, abs=0.05)
    aloft = clearance(motion) > 2e-3
    assert aloft.sum() > 20
    inside = np.flatnonzero(aloft[:-2] & aloft[1:-1] & aloft[2:])
    fall = np.diff(height(motion), 2)[inside] / made.problem.simulation.dt**2
    np.testing.assert_allclose(fall, -GRAVITY, atol=0.05)
