"""PyTorch: gradients through many steps are those of the whole rollout."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import symphys

pytestmark = pytest.mark.slow

torch: Any = pytest.importorskip("torch")


@pytest.fixture(scope="module")
def step(problem: symphys.Problem) -> Any:
    return symphys.torch.step(problem)


def test_the_rollout_has_the_gradient_of_the_kernel(problem: symphys.Problem) -> None:
    rollout = symphys.torch.rollout(problem)
    Z = (rollout.z().repeat(3, 1) + 0.01 * torch.randn(3, rollout.z().numel(), dtype=torch.float64)).requires_grad_()
    factors = torch.tensor([1.0, -2.0, 0.5], dtype=torch.float64)
    (factors * rollout(Z)).sum().backward()
    rows = Z.detach().numpy()
    assert np.array_equal(rollout(Z).detach().numpy(), rollout.compiled.value(rows))
    assert np.allclose(Z.grad.numpy(), factors.numpy()[:, None] * rollout.compiled.gradient(rows), rtol=1e-14)


def test_a_policy_has_the_gradient_of_the_rollout(problem: symphys.Problem, step: Any) -> None:
    """Twenty steps of backpropagation through time, through contact, against the adjoint of the whole rollout."""
    gains = torch.tensor([-4, -1, 2, 0.5], dtype=torch.float64, requires_grad=True)
    state, observation, inputs = step.start(dtype=torch.float64)
    begun, total = state.requires_grad_(), 0.0
    for k in range(step.steps):
        state, observation, cost = step(state, observation @ gains[:, None], inputs[:, k])
        total = total + cost.sum()
    total.backward()
    rollout = symphys.compile(problem)
    slope = rollout.values(rollout.gradient(rollout.z()))
    assert total.item() == pytest.approx(rollout.value(rollout.z()), rel=1e-12)
    assert gains.grad.numpy() == pytest.approx(slope["gains"], rel=1e-9)
    throw = begun.grad[0, step.compiled.columns["ball.velocity"]].numpy()
    assert throw == pytest.approx(slope["throw"], rel=1e-9, abs=1e-12)


def test_gradcheck(step: Any) -> None:
    state, _, inputs = step.start(2)
    for k in range(6):
        state = step(state, torch.ones(2, 1), inputs[:, k]).state
    action = torch.tensor([[0.3], [-0.2]], dtype=torch.float64, requires_grad=True)
    given = inputs[:, 6].clone().requires_grad_()
    assert torch.autograd.gradcheck(
        lambda a, u: step(state, a, u), (action, given), eps=1e-6, atol=1e-6, rtol=1e-5, nondet_tol=0
    )


def test_precision_is_that_of_the_policy(step: Any) -> None:
    state, observation, _ = step.start(2)
    assert (state.dtype, observation.dtype) == (torch.float64, torch.float32)
    after = step(state, torch.zeros(2, 1, requires_grad=True))
    assert (after.state.dtype, after.observation.dtype, after.cost.dtype) == (
        torch.float64,
        torch.float32,
        torch.float32,
    )
    with pytest.raises(RuntimeError, match="does not require grad"):
        action = torch.zeros(2, 1, requires_grad=True)
        (slope,) = torch.autograd.grad(step(state, action).cost.sum(), action, create_graph=True)
        slope.sum().backward()


@pytest.mark.slow
def test_quantities_over_time(problem: symphys.Problem) -> None:
    """Those of the motion; a loss of one's own has the slope that differences have."""
    rollout = symphys.torch.rollout(problem, "ball.position", "rail.position - 0.3")
    Z = rollout.z().repeat(2, 1).requires_grad_()
    value, position, place = rollout(Z)
    motion = symphys.simulate(problem)
    assert position[1].detach().numpy() == pytest.approx(motion["ball.position"][1:], abs=1e-12)
    assert place[0, :, 0].detach().numpy() == pytest.approx(motion["rail.position"][1:] - 0.3, abs=1e-12)
    assert value.detach().numpy() == pytest.approx(rollout.compiled.value(Z.detach().numpy()), rel=1e-14)

    def loss(rows: Any) -> Any:
        value, position, place = rollout(rows)
        return (value + position.pow(3).sum((1, 2)) + 2 * place[:, 7, 0]).sum()

    assert torch.autograd.gradcheck(loss, (Z[:1].detach().requires_grad_(),), eps=1e-6, atol=1e-5, rtol=1e-5)
    with pytest.raises(symphys.SymphysError, match=r'"ball.positon".*"ball.position"'):
        symphys.torch.rollout(problem, "ball.positon")
