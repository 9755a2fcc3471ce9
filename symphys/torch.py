"""Rollouts and steps as differentiable functions of PyTorch tensors; needs the extra ``symphys[torch]``.

Batches go to the compiled kernels, in double precision. States stay in double precision; observations and costs have
the precision and the device of the action. Gradients are those of the kernels; they cannot be differentiated again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symphys.api.compiled import CompiledRollout, compile
from symphys.api.loading import Source
from symphys.api.stepping import CompiledStep, compile_step
from symphys.transcription.open_step import StepResult, StepStart
from symphys.transcription.recorded_rollout import RecordedRollout
from symphys.types import Array

try:
    import torch
except ImportError as error:
    raise ImportError('symphys.torch needs PyTorch: pip install "symphys[torch]"') from error

Tensor = Any
"""torch.Tensor"""
Policy = Callable[[Tensor], Tensor]


def rollout(problem: Source, *quantities: str, smoothing: float = 0.0, backend: str = "auto") -> TorchRollout:
    """A problem's rollout as a function of Z (B, n): the value of each row, and quantities over time if asked for.

    Args:
        problem: what ``symphys.load`` takes.
        quantities: formulas as in problem files, such as ``ball.position``.
        smoothing: of the contacts [m/s].
        backend: see ``symphys.compile``.

    Raises:
        SymphysError: a quantity is no formula, or names what the problem does not have.

    Example:
        >>> import torch, symphys.torch
        >>> rollout = symphys.torch.rollout("ball_throw")
        >>> Z = rollout.z(throw=[8, 0, 3]).repeat(4, 1).requires_grad_()
        >>> rollout(Z).sum().backward()
        >>> tuple(Z.grad.shape)
        (4, 6)
        >>> value, position = symphys.torch.rollout("ball_throw", "ball.position")(Z)
        >>> tuple(position.shape)
        (4, 500, 3)
    """
    return TorchRollout(problem, *quantities, smoothing=smoothing, backend=backend)


def step(problem: Source, controllers: Sequence[str] | None = None, **options: Any) -> TorchStep:
    """One step with the commands open, for batches of states and actions.

    Args:
        problem: what ``symphys.load`` takes.
        controllers: names of those that are left open; see ``symphys.compile_step`` for None, and for errors.
        options: of ``symphys.compile_step``.

    Example:
        >>> import torch, symphys.torch
        >>> step = symphys.torch.step("cart_pole")
        >>> state, observation, inputs = step.start(4)
        >>> action = torch.ones(4, step.action_size, requires_grad=True)
        >>> state, observation, cost = step(state, action)
        >>> cost.sum().backward()
        >>> tuple(action.grad.shape)
        (4, 1)
    """
    return TorchStep(problem, controllers, **options)


class TorchRollout:
    """A problem's rollout as a function of Z (B, n): the value of each row, and quantities over time if asked for."""

    def __init__(self, problem: Source, *quantities: str, smoothing: float = 0.0, backend: str = "auto") -> None:
        """See ``rollout``."""
        self.compiled: CompiledRollout = compile(problem, smoothing, backend)
        self.recording = self.compiled.recording(*quantities) if quantities else None

    def z(self, values: Mapping[str, ArrayLike] | None = None, /, **variables: ArrayLike) -> Tensor:
        """(n,): the guess, with some variables replaced by name."""
        return torch.from_numpy(self.compiled.z(values, **variables))

    def __call__(self, Z: Tensor) -> Any:
        """(B,) the values of Z (B, n); with quantities (value, quantity, ...), each (B, N, k) at the ends of steps."""
        if self.recording is None:
            return RolloutFunction.apply(Z, self.compiled)
        return RecordingFunction.apply(Z, self.recording)


class TorchStep:
    """One step with the commands open, for batches of states and actions; see ``symphys.compile_step``."""

    def __init__(self, problem: Source, controllers: Sequence[str] | None = None, **options: Any) -> None:
        """See ``step``."""
        self.compiled: CompiledStep = compile_step(problem, controllers, **options)
        self.state_size, self.action_size = self.compiled.state_size, self.compiled.action_size
        self.observation_size, self.steps = self.compiled.observation_size, self.compiled.steps

    def start(self, count: int = 1, seed: int | None = None, dtype: Any = None) -> StepStart:
        """Where motions begin; see ``CompiledStep.start``. ``dtype``: of the observation; None: torch's default."""
        state, observation, inputs = (torch.from_numpy(part) for part in self.compiled.start(count, seed))
        return StepStart(state, observation.to(dtype or torch.get_default_dtype()), inputs)

    def __call__(self, state: Tensor, action: Tensor, inputs: Tensor | None = None) -> StepResult:
        """State and observation after a step, and its cost; gradients flow to the state and to the action.

        Args:
            state: (B, s).
            action: (B, m).
            inputs: (B, i) what acts besides, ``start.inputs[:, k]``; None: what the guess has at that time.
        """
        return StepResult(*StepFunction.apply(state, action, inputs, self.compiled))

    def episode(self, policy: Policy, count: int = 1, seed: int | None = None, steps: int | None = None) -> Tensor:
        """(B,) the costs of whole motions, whose actions a policy gives; gradients flow through all of it.

        Args:
            policy: from observations (B, o) to actions (B, m), such as a ``torch.nn.Module``.
            count: B.
            seed: of the samples of scenarios; None: the problem's own, ``count`` times.
            steps: how many; None: those of the problem. Gradients through long motions may grow beyond use.
        """
        state, observation, inputs = self.start(count, seed)
        total = torch.zeros(count, dtype=observation.dtype)
        for k in range(self.steps if steps is None else steps):
            state, observation, cost = self(state, policy(observation), inputs[:, k])
            total = total + cost
        return total


class RolloutFunction(torch.autograd.Function):
    """Values, and their gradients, which are computed with them."""

    @staticmethod
    def forward(ctx: Any, Z: Tensor, compiled: CompiledRollout) -> Tensor:
        """See ``TorchRollout``."""
        rows = numbers(Z)
        if not Z.requires_grad:
            return like(Z, compiled.value(rows))
        value, slope = compiled.value_and_gradient(rows)
        ctx.save_for_backward(like(Z, slope))
        return like(Z, value)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, adjoint: Tensor) -> tuple[Tensor, None]:
        """The adjoint of Z."""
        (slope,) = ctx.saved_tensors
        return adjoint[..., None] * slope, None


class RecordingFunction(torch.autograd.Function):
    """Values and quantities, and their adjoint, for which they are computed again."""

    @staticmethod
    def forward(ctx: Any, Z: Tensor, recording: RecordedRollout) -> tuple[Tensor, ...]:
        """See ``TorchRollout``."""
        ctx.called, ctx.kind = (recording, numbers(Z)), Z.new_empty(0)
        value, found = recording.forward(ctx.called[1])
        return tuple(like(Z, part) for part in (value, *found.values()))

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *adjoints: Tensor) -> tuple[Tensor, None]:
        """The adjoint of Z."""
        recording, rows = ctx.called
        value, *found = map(numbers, adjoints)
        return like(ctx.kind, recording.pull(rows, value, dict(zip(recording.quantities, found, strict=True)))), None


class StepFunction(torch.autograd.Function):
    """A step, and its adjoint, for which it is computed again."""

    @staticmethod
    def forward(
        ctx: Any, state: Tensor, action: Tensor, inputs: Tensor | None, step: CompiledStep
    ) -> tuple[Tensor, ...]:
        """See ``TorchStep``."""
        given = None if inputs is None else numbers(inputs)
        ctx.called = step, numbers(state), numbers(action), given
        ctx.kinds = [None if each is None else each.new_empty(0) for each in (state, action, inputs)]
        after, observation, cost = step(*ctx.called[1:])
        return like(state, after), like(action, observation), like(action, cost)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *adjoints: Tensor) -> tuple[Tensor | None, ...]:
        """The adjoints of state, action and inputs."""
        step, state, action, given = ctx.called
        slopes = step.pull(state, action, *(numbers(adjoint) for adjoint in adjoints), inputs=given)
        back = (None if kind is None else like(kind, slope) for kind, slope in zip(ctx.kinds, slopes, strict=True))
        return (*back, None)


def numbers(tensor: Tensor) -> Array:
    """A tensor's numbers here, in double precision."""
    return np.asarray(tensor.detach().cpu().numpy(), np.float64)


def like(tensor: Tensor, values: ArrayLike) -> Tensor:
    """Numbers as a tensor of the precision and on the device of another."""
    return torch.as_tensor(np.asarray(values), dtype=tensor.dtype, device=tensor.device)
