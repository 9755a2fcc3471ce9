"""A hopper learns commands that make it jump."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import met, shipped, short_descent


@pytest.mark.thorough
def test_a_short_descent_takes_it_nearer() -> None:
    """Starts that are off by 1e-13 end between 0.21 and 0.62 of it."""
    before, after = short_descent("hopper_jump", 40)
    assert after < 0.65 * before


@pytest.mark.thorough
@pytest.mark.parametrize("wanted", [1, 2])
def test_it_jumps_half_a_metre(wanted: int) -> None:
    """From one seed of three, or two: aloft for 0.1 s at least, landing on its foot, the leg within its limits."""
    made = shipped("hopper_jump")
    for found in met("gradient", made, of=3, wanted=wanted):
        motion = made.simulate(found.z)
        foot, torso = (motion.body_names.index(name) for name in ("foot", "torso"))
        assert np.linalg.norm(motion.position[-1, foot] - [0.5, 0, 0.05]) < 0.05
        assert np.linalg.norm(motion.position[0, foot] - [0, 0, 0.05]) < 1e-6
        force = np.linalg.norm(motion.contact_force, axis=2).sum(axis=1)
        aloft = np.flatnonzero(force == 0)
        assert np.max(np.diff(np.flatnonzero(force > 0))) >= 10
        assert motion.position[aloft, foot, 2].max() > 0.1
        assert motion.position[:, torso, 2].min() > 0.3
        leg = motion.joint_value[:, motion.joint_names.index("thruster"), 0]
        assert leg.min() > -0.15 - 1e-3
        assert leg.max() < 1e-3
