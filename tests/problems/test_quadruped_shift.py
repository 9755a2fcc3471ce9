"""A net learns to move the torso of a quadruped that stands."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import met, shipped
from scipy.spatial.transform import Rotation


@pytest.mark.thorough
@pytest.mark.parametrize("wanted", [1, 2])
def test_the_net_shifts_the_torso(wanted: int) -> None:
    """From one seed of three, or two: to 5 mm, on feet that stay where they are; without the net it stays."""
    made = shipped("quadruped_shift")
    assert made.shooting.n == 976
    still = made.simulate(np.zeros(976))
    assert np.abs(still.position[-1, 0, :2]).max() < 5e-3
    for found in met("gradient", made, of=3, wanted=wanted):
        motion = made.simulate(found.z)
        assert np.abs(motion.position[-1, 0] - [0.03, 0.03, 0.55]).max() < 0.005
        assert np.abs(motion.velocity[-1, 0]).max() < 0.02
        assert (motion.contact_force[-1, :, 2] > 5).sum() >= 3
        legs = [motion.body_names.index(f"{leg}_lower") for leg in ("fl", "fr", "hl", "hr")]
        w, *axis = np.moveaxis(motion.orientation[-1, legs], 1, 0)
        feet = motion.position[-1, legs] + Rotation.from_quat(np.stack([*axis, w], axis=1)).apply([0, 0, -0.15])
        assert np.abs(feet[:, :2] - [[0.3, 0.2], [0.3, -0.2], [-0.3, 0.2], [-0.3, -0.2]]).max() < 0.02
        assert np.abs(motion.joint_torque).max() < 30 + 1e-9
