"""Rotation vectors between quaternions, and their derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from symphys.prediction.rotations import rotation_slopes, rotation_vectors, turned


def quaternions(rotations: Rotation) -> np.ndarray:
    return rotations.as_quat(scalar_first=True)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-5, 1e-3, 1.0, 3.0])
def test_they_are_scipys_and_do_not_depend_on_signs(size: float) -> None:
    rng = np.random.default_rng(0)
    first = Rotation.random(20, rng=1)
    axis = rng.normal(size=(20, 3))
    vector = size * axis / np.linalg.norm(axis, axis=1, keepdims=True)
    second = first * Rotation.from_rotvec(vector)
    q, p = quaternions(first), quaternions(second)
    assert rotation_vectors(q, p) == pytest.approx(vector, rel=1e-9, abs=1e-14)
    assert rotation_vectors(q, -p) == pytest.approx(vector, rel=1e-9, abs=1e-14)
    h, slopes = 1e-6, rotation_slopes(q, p)
    for j in range(4):
        step = h * np.eye(4)[j]
        expected = (rotation_vectors(q, p + step) - rotation_vectors(q, p - step)) / (2 * h)
        assert slopes[:, :, j] == pytest.approx(expected, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("size", [0.0, 1e-5, 1e-3, 0.7, 3.0])
def test_a_turn_is_scipys_and_has_the_derivative_of_differences(size: float) -> None:
    first, v = Rotation.random(rng=2), size * np.array([0.6, 0.0, -0.8])
    q = quaternions(first)
    found, slope = turned(q, v)
    expected = quaternions(first * Rotation.from_rotvec(v))
    assert found * np.sign(found @ expected) == pytest.approx(expected, abs=1e-14)
    for j in range(3):
        step = 1e-6 * np.eye(3)[j]
        difference = (turned(q, v + step)[0] - turned(q, v - step)[0]) / 2e-6
        assert slope[:, j] == pytest.approx(difference, abs=1e-9)
