"""Several decisions, of which some are at their bounds: against the closed form of one step without coupling."""

from __future__ import annotations

import numpy as np
import pytest
from worlds.toys import require

from symphys.codegen.runtime.riccati import compiled_riccati
from symphys.solvers.ddp.riccati import CostToGo, LinearSteps, riccati_recursion


def test_decisions_at_bounds_do_not_answer_the_state() -> None:
    """min of g v + h v^2 / 2 + v c x, each decision apart: those within answer by -c / h, the one beyond stays."""
    g, h, c = np.array([1.0, -4.0, 0.5]), np.array([2.0, 1.0, 4.0]), np.array([[0.3, 1.0], [2.0, 3.0], [0.5, -1.0]])
    slope, curve = np.zeros(5), np.zeros((5, 5))
    slope[2:], curve[2:, 2:], curve[2:, :2], curve[:2, 2:] = g, np.diag(h), c, c.T
    parts = np.zeros((2, 5)), slope, curve, np.full(3, -1.0), np.full(3, 1.0), np.zeros(3)
    step = LinearSteps(*(each[None] for each in parts))
    found = riccati_recursion([step], CostToGo(np.zeros(2), np.zeros((2, 2))))
    assert found is not None
    (ahead,), (back,) = found.feedback[0]
    v, answers = np.clip(-g / h, -1, 1), -c / h[:, None] * np.array([[1.0], [0.0], [1.0]])
    assert ahead == pytest.approx(v)
    assert back == pytest.approx(answers)
    assert found.first + found.second == pytest.approx(float(g @ v + h @ v**2 / 2))
    assert found.cost.slope == pytest.approx(answers.T @ (g + h * v) + c.T @ v)
    assert found.cost.curve == pytest.approx(answers.T @ np.diag(h) @ answers + answers.T @ c + c.T @ answers)


@pytest.mark.parametrize(
    ("n", "w", "steps", "room"), [(7, 1, 20, 0.1), (5, 3, 12, 9.0), (5, 3, 12, 0.05), (4, 2, 1, 0.1)]
)
def test_compiled_runs_are_those_of_numpy(n: int, w: int, steps: int, room: float) -> None:
    """Within bounds, at some of them, and a run of one step after which the state has another size."""
    require("simd")
    compiled, rng = compiled_riccati(), np.random.default_rng(n)
    after = n if steps > 1 else n + 2
    halves, last = rng.normal(size=(steps, n + w, n + w)), rng.normal(size=(after, after))
    curve = halves @ halves.transpose(0, 2, 1) / 10 + 0.1 * np.eye(n + w)
    bounds = room * rng.uniform(size=(2, steps, w))
    through, slope = 0.4 * rng.normal(size=(steps, after, n + w)), rng.normal(size=(steps, n + w))
    run = LinearSteps(through, slope, curve, -bounds[0], bounds[1], np.full((steps, w), 0.01))
    cost = CostToGo(rng.normal(size=after), last @ last.T / 10)
    own, found = (riccati_recursion([run], cost, each) for each in (None, compiled))
    assert compiled is not None
    assert compiled.suits(through)
    assert own is not None
    assert found is not None
    for one, other in zip(own.feedback, found.feedback, strict=True):
        np.testing.assert_allclose(other.ahead, one.ahead, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(other.back, one.back, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose([*found[1:3], *found.cost.slope], [*own[1:3], *own.cost.slope], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.cost.curve, own.cost.curve, rtol=1e-9, atol=1e-12)


def test_compiled_costates_are_those_of_numpy() -> None:
    """Also of matrices that are the first columns of wider ones."""
    require("simd")
    compiled, rng = compiled_riccati(), np.random.default_rng(1)
    assert compiled is not None
    a, slopes, costate = rng.normal(size=(6, 4, 9))[:, :, :4], rng.normal(size=(6, 4)), rng.normal(size=4)
    after, first = compiled.costates(a, slopes, costate)
    for k in reversed(range(6)):
        np.testing.assert_allclose(after[k], costate, rtol=1e-13)
        costate = slopes[k] + costate @ a[k]
    np.testing.assert_allclose(first, costate, rtol=1e-13)


def test_a_hessian_that_is_not_positive_definite_is_refused() -> None:
    require("simd")
    run = LinearSteps(np.eye(1, 2)[None], np.ones((1, 2)), -np.eye(2)[None], *np.full((3, 1, 1), 0.5))
    assert riccati_recursion([run], CostToGo(np.zeros(1), np.zeros((1, 1))), compiled_riccati()) is None
