"""Problems whose formulas take parts of the whole motion, against their closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from shipped import shipped, solve

GRAVITY = 9.81


def test_the_bounce_repeats_itself() -> None:
    found = solve("least_squares", shipped("bounce_cycle"))
    height, speed = found.z
    assert height == pytest.approx(0.1 + GRAVITY * 0.8**2 / 8, abs=1e-4)
    assert speed == pytest.approx(1.2 / 0.8, abs=1e-4)


def test_the_push_of_least_cost_of_transport_falls_linearly() -> None:
    made = shipped("cost_of_transport")
    found = solve("ipopt", made)
    least = 2 * np.sqrt(3 * 5 * 0.02) / (4 * GRAVITY)
    assert made.judge(found.z).objective == pytest.approx(least, rel=1e-4)
    first = np.sqrt(3 * 5 / 0.02)
    assert found.z == pytest.approx(np.linspace(first, 0, 21), abs=0.01 * first)
