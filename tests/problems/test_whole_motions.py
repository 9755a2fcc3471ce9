"""Problems about whole motions, of which formulas take parts or whose duration is free, against closed forms."""

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


def test_the_fastest_move_is_bang_bang() -> None:
    made = shipped("fastest_move")
    found = solve("ipopt", made)
    assert found.z[0] == pytest.approx(2 * np.sqrt(1.5 * 2 / 10), abs=1e-6)
    assert found.z[1:] == pytest.approx(np.repeat([10.0, -10.0], 10), abs=1e-4)
    assert made.simulate(found.z).time[-1] == pytest.approx(found.z[0])


def test_the_push_before_the_flight_falls_linearly() -> None:
    made = shipped("push_and_fly")
    found = solve("ipopt", made)
    slope = 3 * 2 * (0.5 + GRAVITY / 2) / (1 - 0.6**3)
    middles = (np.arange(20) + 0.5) / 50
    assert found.z[:20] == pytest.approx(slope * (1 - middles), abs=0.05)
    assert found.z[20:] == pytest.approx(0, abs=1e-3)
