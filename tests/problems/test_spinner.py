"""A finger turns a spinner that it does not touch in the guess."""

from __future__ import annotations

import numpy as np
import pytest
from shipped import shipped, solve

from symphys.verification.refinement import FINER_DT, finer_problem


def test_the_guess_touches_nothing_and_influences_nothing() -> None:
    made = shipped("spinner", "casadi")
    motion = made.simulate(made.shooting.start(0))
    tip = np.array([np.sin(0.3) + 0.95 * np.sin(1.8), np.cos(0.3) + 0.95 * np.cos(1.8)])
    gap = np.linalg.norm(tip - [1.5, 1.0]) - 0.05 - 0.25
    assert gap == pytest.approx(0.08195, abs=1e-5)
    far = motion["far.position"][0, [0, 2]]
    np.testing.assert_allclose(far, tip - 0.45 * np.array([np.sin(1.8), np.cos(1.8)]), atol=1e-12)
    assert np.abs(motion["axle.angle"]).max() == 0.0


@pytest.mark.slow
def test_smoothing_finds_the_contact() -> None:
    made = shipped("spinner")
    found = solve("ilqr", made)
    verdict, finer = made.judge(found.z), finer_problem(made, FINER_DT).judge(found.z)
    assert verdict.solved
    assert verdict.objective < 2.0
    assert finer.checks[0].error < 0.2
