"""Second moments and correlations of a mass: every one within bounds is a body, and every body has them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symphys.problem.parametric.parts import distribution, inertia
from symphys.problem.tables.bodies import inertia_fault


def tensor(value: object) -> np.ndarray:
    """(3, 3)."""
    found = np.array(value, float)
    return found if found.ndim == 2 else np.diag(np.broadcast_to(found, 3))


def test_a_tensor_comes_back() -> None:
    """Of ten points of mass anywhere."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        points, masses = rng.normal(size=(10, 3)), rng.uniform(0.1, 1, 10)
        points -= masses @ points / masses.sum()
        sigma = points.T @ (masses[:, None] * points)
        whole = np.trace(sigma) * np.eye(3) - sigma
        moments, correlations = distribution(whole)
        assert moments == pytest.approx(np.diag(sigma))
        assert tensor(inertia(moments, correlations)) == pytest.approx(whole)


MOMENT = st.floats(1e-6, 1e3)
CORRELATION = st.floats(-1, 1)


@settings(deadline=None)
@given(st.tuples(MOMENT, MOMENT, MOMENT), st.tuples(CORRELATION, CORRELATION, CORRELATION))
def test_bounds_alone_keep_it_physical(moments: tuple[float, ...], correlations: tuple[float, ...]) -> None:
    found = tensor(inertia(moments, correlations))
    sigma = np.trace(found) / 2 * np.eye(3) - found
    assert np.linalg.eigvalsh(sigma).min() >= -1e-9 * np.trace(found)
    assert "exceed" not in inertia_fault(found.tolist())


@pytest.mark.parametrize(
    ("given", "moments"), [(2.0, (1, 1, 1)), ((1.0, 2.0, 3.0), (2, 1, 0)), ((5.0, 4.0, 3.0), (1, 2, 3))]
)
def test_principal_moments_stay_three(given: object, moments: tuple[float, ...]) -> None:
    found, correlations = distribution(given)
    assert (found, correlations) == (pytest.approx(moments), (0, 0, 0))
    assert inertia(found, correlations) == pytest.approx(np.diag(tensor(given)))


def test_a_rod_has_moments_and_no_room_for_correlations() -> None:
    """Flat and thin bodies meet bounds with equality; no number is NaN there."""
    direction = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    rod = np.eye(3) - np.outer(direction, direction)
    moments, correlations = distribution(rod)
    assert moments == pytest.approx((0.5, 0.5, 0))
    assert correlations == pytest.approx((1, 0, 0))
    assert tensor(inertia(moments, correlations)) == pytest.approx(rod)
