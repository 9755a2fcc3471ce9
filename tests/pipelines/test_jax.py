"""JAX: gradients through many steps are those of the whole rollout, under jit, scan and vmap."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import symphys

pytestmark = pytest.mark.slow

jax: Any = pytest.importorskip("jax")


@pytest.fixture(autouse=True)
def double() -> Iterator[None]:
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", False)


def test_single_precision_is_refused(problem: symphys.Problem) -> None:
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(symphys.SymphysError, match="jax_enable_x64"):
        symphys.jax.step(problem)


def test_the_rollout_has_the_gradient_of_the_kernel(problem: symphys.Problem) -> None:
    rollout = symphys.jax.rollout(problem)
    Z = np.asarray(rollout.z()) + 0.01 * np.random.default_rng(0).normal(size=(3, rollout.compiled.n))
    factors = np.array([1.0, -2.0, 0.5])
    slope = jax.jit(jax.grad(lambda Z: (factors * rollout(Z)).sum()))(Z)
    assert np.array_equal(rollout(Z), rollout.compiled.value(Z))
    assert np.allclose(slope, factors[:, None] * rollout.compiled.gradient(Z), rtol=1e-14)
    assert np.allclose(jax.vmap(jax.grad(rollout))(Z), rollout.compiled.gradient(Z), rtol=1e-14)


@pytest.mark.slow
def test_a_policy_has_the_gradient_of_the_rollout(problem: symphys.Problem) -> None:
    """Through lax.scan and jit, against the adjoint of the whole rollout."""
    step, rollout = symphys.jax.step(problem), symphys.compile(problem)
    begun = step.start()

    def total(gains: Any) -> Any:
        def one(carried: Any, inputs: Any) -> Any:
            state, observation, cost = step(carried[0], carried[1] @ gains[:, None], inputs)
            return (state, observation), cost.sum()

        inputs = jax.numpy.swapaxes(begun.inputs, 0, 1)
        return jax.lax.scan(one, (begun.state, begun.observation), inputs)[1].sum()

    gains = jax.numpy.array([-4, -1, 2, 0.5])
    value, slope = jax.jit(jax.value_and_grad(total))(gains)
    assert float(value) == pytest.approx(rollout.value(rollout.z()), rel=1e-12)
    assert np.asarray(slope) == pytest.approx(rollout.values(rollout.gradient(rollout.z()))["gains"], rel=1e-9)


def test_the_adjoint_by_differences(problem: symphys.Problem) -> None:
    from jax.test_util import check_grads

    step = symphys.jax.step(problem)
    state, _, inputs = step.start(2)
    for k in range(6):
        state = step(state, np.ones((2, 1)), inputs[:, k]).state
    called = (np.array([[0.3], [-0.2]]), np.asarray(inputs[:, 6]))
    check_grads(lambda a, u: step(state, a, u), called, 1, modes=["rev"], atol=1e-5, rtol=1e-5)


@pytest.mark.slow
def test_quantities_over_time(problem: symphys.Problem) -> None:
    from jax.test_util import check_grads

    rollout = symphys.jax.rollout(problem, "ball.position", "rail.position")
    Z = np.asarray(rollout.z())[None]
    motion = symphys.simulate(problem)
    _, position, place = jax.jit(rollout)(Z)
    assert np.asarray(position[0]) == pytest.approx(motion["ball.position"][1:], abs=1e-12)
    assert np.asarray(place[0, :, 0]) == pytest.approx(motion["rail.position"][1:], abs=1e-12)
    check_grads(rollout, (Z,), 1, modes=["rev"], atol=1e-5, rtol=1e-5)
