"""A glass on a tray: friction limits how fast it can be carried."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, solve

SHARE, FRICTION, GRAVITY, MASS, DISTANCE = 0.95, 0.3, 9.81, 1.3, 1.0
FASTEST = 2 * np.sqrt(DISTANCE / (SHARE * FRICTION * GRAVITY))
"""[s] Bang-bang control of tray and glass together."""


@pytest.mark.parametrize(("share", "slips"), [(0.9, False), (1.2, True)])
def test_friction_limits_the_acceleration(share: float, slips: bool) -> None:
    made = shipped("fast_tray", "casadi")
    force = share * FRICTION * GRAVITY * MASS
    motion = made.simulate(np.array([1.0, *np.full(16, force)]))
    ahead = motion["tray.velocity"][-1, 0] - motion["glass.velocity"][-1, 0]
    assert (ahead > 0.1) == slips
    if not slips:
        assert ahead == pytest.approx(0, abs=0.01)


@pytest.mark.thorough
def test_as_fast_as_friction_allows() -> None:
    made = shipped("fast_tray")
    found = solve("ilqr", made)
    verdict = made.judge(found.z)
    assert verdict.solved
    assert verdict.objective == pytest.approx(FASTEST, abs=1e-3)
