"""Batches of rollouts: rows alone, gradients against differences, and the numbers of the kernel itself."""

from __future__ import annotations

import numpy as np
import pytest
from worlds.thrown import TABLES

import symphys


@pytest.fixture(scope="module")
def rollout(problem: symphys.Problem) -> symphys.CompiledRollout:
    return symphys.compile(problem)


@pytest.mark.slow
def test_rows_are_those_alone(rollout: symphys.CompiledRollout) -> None:
    Z = rollout.z() + 0.1 * np.random.default_rng(0).standard_normal((5, rollout.n))
    assert rollout.value(Z).shape == (5,) and rollout.gradient(Z).shape == (5, rollout.n)
    assert np.array_equal(rollout.value(Z)[3], rollout.value(Z[3]))
    assert np.array_equal(rollout.gradient(Z)[3], rollout.gradient(Z[3]))
    value, slope = rollout.value_and_gradient(Z)
    assert np.array_equal(value, rollout.value(Z)) and np.array_equal(slope, rollout.gradient(Z))


@pytest.mark.slow
def test_gradient_by_differences(rollout: symphys.CompiledRollout) -> None:
    z, h = rollout.z(throw=[1.2, 0.1, 0.4]), 1e-6
    sides = [rollout.value(z + sign * h * np.eye(rollout.n)) for sign in (1, -1)]
    assert rollout.gradient(z) == pytest.approx((sides[0] - sides[1]) / (2 * h), rel=1e-6, abs=1e-7)


def test_the_value_is_the_sum_of_squares(rollout: symphys.CompiledRollout) -> None:
    z = rollout.z()
    r, J = rollout.residuals(z), rollout.jacobian(z)
    assert rollout.value(z) == pytest.approx(float(r @ r), rel=1e-12)
    assert rollout.gradient(z) == pytest.approx(2 * J.T @ r, rel=1e-9)


def test_variables_by_name(rollout: symphys.CompiledRollout) -> None:
    """A number, or one for each component, holds for all knots; what does not fit is said with what would."""
    z = rollout.z(push=2, throw=[1, 2, 3])
    parts = rollout.values(z)
    assert np.array_equal(parts["push"], np.full((3, 1), 2)) and np.array_equal(parts["throw"], [1, 2, 3])
    assert np.array_equal(rollout.z(parts), z)
    assert np.array_equal(rollout.z(push=[1, 2, 3]), rollout.z(push=[[1], [2], [3]]))
    with pytest.raises(symphys.SymphysError, match=r'"push" .*\(3, 1\)'):
        rollout.z(push=[1, 2])
    with pytest.raises(symphys.SymphysError, match="push"):
        rollout.z(pusch=1)
    with pytest.raises(ValueError, match=r"\(batch, 6\)"):
        rollout.value(np.zeros((2, 5)))


def test_the_trajectory_is_that_of_simulate(problem: symphys.Problem, rollout: symphys.CompiledRollout) -> None:
    z = rollout.z(throw=[2, 0, 1])
    assert np.array_equal(rollout.trajectory(z).position, symphys.simulate(problem, throw=[2, 0, 1]).position)
    assert rollout.evaluate(z).outputs == pytest.approx(rollout.trajectory(z)["ball.position"][-1, 2], rel=1e-12)


def test_smoothing_is_of_the_whole_rollout(problem: symphys.Problem, rollout: symphys.CompiledRollout) -> None:
    soft = symphys.compile(problem, smoothing=0.1, backend="casadi")
    landing = rollout.z(throw=[1, 0, -4])
    assert soft.value(landing) != pytest.approx(rollout.value(landing), rel=1e-6)
    assert np.array_equal(
        soft.trajectory(landing).position, symphys.simulate(problem, smoothing=0.1, throw=[1, 0, -4]).position
    )


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["auto", "casadi"])
def test_without_squares_there_are_no_residuals(backend: str) -> None:
    """It is said with the problem's name, whatever evaluates."""
    tables = {**TABLES, "cost": [{"name": "low", "value": "ball.position[2]"}]}
    rollout = symphys.compile(tables, backend=backend)
    for asked in (rollout.residuals, rollout.jacobian):
        with pytest.raises(symphys.SymphysError, match=r"problem: .*squares"):
            asked(rollout.z())
    assert np.isfinite(rollout.gradient(rollout.z())).all()
