"""Several decisions, of which some are at their bounds: against the closed form of one step without coupling."""

from __future__ import annotations

import numpy as np
import pytest

from symphys.solvers.ddp.riccati import CostToGo, LinearStep, riccati_recursion


def test_decisions_at_bounds_do_not_answer_the_state() -> None:
    """min of g v + h v^2 / 2 + v c x, each decision apart: those within answer by -c / h, the one beyond stays."""
    g, h, c = np.array([1.0, -4.0, 0.5]), np.array([2.0, 1.0, 4.0]), np.array([[0.3, 1.0], [2.0, 3.0], [0.5, -1.0]])
    slope, curve = np.zeros(5), np.zeros((5, 5))
    slope[2:], curve[2:, 2:], curve[2:, :2], curve[:2, 2:] = g, np.diag(h), c, c.T
    step = LinearStep(np.zeros((2, 5)), slope, curve, np.full(3, -1.0), np.full(3, 1.0), np.zeros(3))
    found = riccati_recursion([step], CostToGo(np.zeros(2), np.zeros((2, 2))))
    assert found is not None
    assert found.feedback[0] is not None
    ahead, back = found.feedback[0]
    v, answers = np.clip(-g / h, -1, 1), -c / h[:, None] * np.array([[1.0], [0.0], [1.0]])
    assert ahead == pytest.approx(v)
    assert back == pytest.approx(answers)
    assert found.first + found.second == pytest.approx(float(g @ v + h @ v**2 / 2))
    assert found.cost.slope == pytest.approx(answers.T @ (g + h * v) + c.T @ v)
    assert found.cost.curve == pytest.approx(answers.T @ np.diag(h) @ answers + answers.T @ c + c.T @ answers)
