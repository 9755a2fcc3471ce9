"""A free kick with drag and lift, against scipy's integration of the same equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from data.shipped import shipped, solve
from scipy.integrate import solve_ivp

MASS, DRAG, LIFT = 0.43, 0.0064, 0.0059


def test_the_kick_that_is_found_is_in_the_corner() -> None:
    found = solve("least_squares", shipped("free_kick"), polish=True)

    def slope(_: float, y: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        v = y[3:]
        speed = np.linalg.norm(v)
        force = -DRAG * speed * v + LIFT * speed * np.cross([0, 0, 1], v)
        return np.concatenate([v, [0, 0, -9.81] + force / MASS])

    flight = solve_ivp(slope, (0, 1.1), [0, 0, 0.11, *found.z], rtol=1e-10, atol=1e-10)
    assert flight.y[:3, -1] == pytest.approx([25, 3.4, 2.2], abs=2e-4)
    assert found.z[1] < 0  # it starts beside the goal and comes back
