"""An arm whose net learns to bring its hand to a point, within the evaluations of the paper."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import solve, work
from scipy.spatial.transform import Rotation

from symphys import problems
from symphys.problem import load_problem
from symphys.transcription import transcribe

POINT, TIP = np.array([0.2, 0.35, 0.3]), np.array([0, 0, 0.075])


def test_its_net_has_as_many_weights_as_that_of_the_paper() -> None:
    assert sum(variable.guess.size for variable in load_problem(problems.find("arm_reach")).variables) == 17284


@pytest.mark.thorough
@pytest.mark.parametrize(("dt", "seed"), [(0.02, 0), (0.01, 0), (0.01, 1), (0.01, 2)])
def test_reaches_the_point(dt: float, seed: int) -> None:
    """Within 1 cm after 7 s and at the end, in at most 150 gradients; servos stay within their limits."""
    made = transcribe(load_problem(problems.find("arm_reach"), {"simulation.dt": dt}))
    assert made.shooting.n == 17284
    found = solve("gradient", made, seed)
    assert work(found) <= 150
    motion = made.simulate(found.z)
    for k in (round(7 / dt), round(8 / dt)):
        w, *axis = motion.orientation[k, 3]
        tip = motion.position[k, 3] + Rotation.from_quat([*axis, w]).apply(TIP)
        assert np.linalg.norm(tip - POINT) < 0.01
    assert np.abs(motion.joint_value).max() < np.pi / 2 + 1e-3
    assert np.abs(motion.joint_torque).max() < 30 + 1e-9
