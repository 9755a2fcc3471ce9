"""Several decisions, of which some are at their bounds: against the closed form of one step without coupling."""

from __future__ import annotations

import numpy as np
import pytest

from symphys.mpc.horizon_costs import QuadraticCosts
from symphys.mpc.riccati import riccati_pass


def test_decisions_at_bounds_do_not_answer_the_state() -> None:
    """min of g v + h v^2 / 2 + v c x, each decision apart: those within answer by -c / h, the one beyond stays."""
    g, h, c = np.array([1.0, -4.0, 0.5]), np.array([2.0, 1.0, 4.0]), np.array([[0.3, 1.0], [2.0, 3.0], [0.5, -1.0]])
    slope, curve = np.zeros((2, 5)), np.zeros((2, 5, 5))
    slope[0, 2:], curve[0, 2:, 2:], curve[0, 2:, :2] = g, np.diag(h), c
    curve[0, :2, 2:] = c.T
    room = np.full((1, 3), -1.0), np.full((1, 3), 1.0)
    costs = QuadraticCosts(slope, curve, None)
    found = riccati_pass(np.zeros((1, 2, 2)), np.zeros((1, 2, 3)), costs, room, np.zeros(3))
    assert found is not None
    ahead, back = found
    assert ahead[0] == pytest.approx(np.clip(-g / h, -1, 1))
    assert back[0] == pytest.approx(-c / h[:, None] * np.array([[1.0], [0.0], [1.0]]))
