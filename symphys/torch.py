"""Rollouts and steps as differentiable functions of PyTorch tensors; needs the extra ``torch``.

Batches go to the compiled kernels, in double precision. States stay in double precision; observations and costs have
the precision and the device of the action. Gradients are those of the kernels; they cannot be differentiated again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symphys.api.compiled import CompiledRollout, CompiledStep, compile, compile_step
from symphys.errors import install_advice
from symphys.problem.problem import Source
from symphys.transcription.open_step import StepResult, StepStart
from symphys.transcription.recorded_rollout import RecordedRollout
from symphys.types import Array

try:
    import torch
except ImportError as error:
    raise ImportError(f"symphys.torch needs PyTorch: {install_advice('torch')}") from error

Tensor = Any
"""torch.Tensor"""
Policy = Callable[[Tensor], Tensor]
"""A function from observations (B, o) to actions (B, m)."""


def rollout(problem: Source, *quantities: str, smoothing: float = 0.0, backend: str = "auto") -> TorchRollout:
    """Compile a problem's rollout as a differentiable function of Z (B, n).

    Args:
        problem: what ``symphys.load`` takes.
        quantities: formulas as in problem files, such as ``ball.position``.
        smoothing: width of the smoothed contact laws [m/s]; 0 is the exact law.
        backend: what evaluates, as in ``symphys.compile``.

    Returns:
        A function of Z: values (B,); with quantities a tuple of values and of each quantity (B, N, k).

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
    """Compile one time step with the commands open, for batches of states and actions.

    Args:
        problem: what ``symphys.load`` takes.
        controllers: names of the controllers that actions replace, as in ``symphys.compile_step``.
        options: further arguments of ``symphys.compile_step``.

    Raises:
        SymphysError: as ``symphys.compile_step``.

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
    """A problem's rollout as a differentiable function of Z (B, n): values, and quantities over time.

    Attributes:
        compiled: the rollout on numpy arrays.
        recording: the rollout with its quantities; None without quantities.
    """

    def __init__(self, problem: Source, *quantities: str, smoothing: float = 0.0, backend: str = "auto") -> None:
        """Compile the rollout; the arguments are those of ``rollout``."""
        self.compiled: CompiledRollout = compile(problem, smoothing, backend)
        self.recording = self.compiled.recording(*quantities) if quantities else None

    def z(self, values: Mapping[str, ArrayLike] | None = None, /, **variables: ArrayLike) -> Tensor:
        """Return the guess as a decision vector (n,), with some variables replaced by name."""
        return torch.from_numpy(self.compiled.z(values, **variables))

    def __call__(self, Z: Tensor) -> Any:
        """Return the values (B,) of Z (B, n); with quantities also each of these (B, N, k), at the ends of steps."""
        if self.recording is None:
            return RolloutFunction.apply(Z, self.compiled)
        return RecordingFunction.apply(Z, self.recording)


class TorchStep:
    """One time step with the commands open, differentiable, for batches of states and actions.

    Attributes:
        compiled: the step on numpy arrays.
        state_size: the number s of entries of a state.
        action_size: the number m of entries of an action.
        observation_size: the number o of entries of an observation.
        steps: the number of steps of a motion.
    """

    def __init__(self, problem: Source, controllers: Sequence[str] | None = None, **options: Any) -> None:
        """Compile the step; the arguments are those of ``step``."""
        self.compiled: CompiledStep = compile_step(problem, controllers, **options)
        self.state_size, self.action_size = self.compiled.state_size, self.compiled.action_size
        self.observation_size, self.steps = self.compiled.observation_size, self.compiled.steps

    def start(self, count: int = 1, seed: int | None = None, dtype: Any = None) -> StepStart:
        """Return the states (B, s), observations (B, o) and inputs (B, N, i) with which motions start.

        Args:
            count: the number B of motions.
            seed: seed of the samples of scenarios; None: the problem's own, ``count`` times.
            dtype: type of the observations; None: torch's default.
        """
        state, observation, inputs = (torch.from_numpy(part) for part in self.compiled.start(count, seed))
        return StepStart(state, observation.to(dtype or torch.get_default_dtype()), inputs)

    def __call__(self, state: Tensor, action: Tensor, inputs: Tensor | None = None) -> StepResult:
        """Return state and observation after a step, and its cost; gradients flow to all three arguments.

        Args:
            state: (B, s).
            action: (B, m).
            inputs: (B, i) forces and commands that act as well, ``start.inputs[:, k]``; None: those of the guess at
                the time of the state.
        """
        return StepResult(*StepFunction.apply(state, action, inputs, self.compiled))

    def episode(self, policy: Policy, count: int = 1, seed: int | None = None, steps: int | None = None) -> Tensor:
        """Run a policy through whole motions and return their costs (B,); gradients flow through every step.

        Args:
            policy: a function from observations (B, o) to actions (B, m), such as a ``torch.nn.Module``.
            count: the number B of motions.
            seed: seed of the samples of scenarios; None: the problem's own, ``count`` times.
            steps: number of steps; None: those of the problem. Gradients through long motions may become too large
                to be useful.
        """
        state, observation, inputs = self.start(count, seed)
        total = torch.zeros(count, dtype=observation.dtype)
        for k in range(self.steps if steps is None else steps):
            state, observation, cost = self(state, policy(observation), inputs[:, k])
            total = total + cost
        return total


class RolloutFunction(torch.autograd.Function):
    """Values of rollouts; their gradients are computed together with them."""

    @staticmethod
    def forward(ctx: Any, Z: Tensor, compiled: CompiledRollout) -> Tensor:
        """Evaluate Z, with gradients if any are needed."""
        rows = numbers(Z)
        if not Z.requires_grad:
            return like(Z, compiled.value(rows))
        value, slope = compiled.value_and_gradient(rows)
        ctx.save_for_backward(like(Z, slope))
        return like(Z, value)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, adjoint: Tensor) -> tuple[Tensor, None]:
        """Return the adjoint of Z."""
        (slope,) = ctx.saved_tensors
        return adjoint[..., None] * slope, None


class RecordingFunction(torch.autograd.Function):
    """Values and quantities of rollouts; their adjoint evaluates the rollouts again."""

    @staticmethod
    def forward(ctx: Any, Z: Tensor, recording: RecordedRollout) -> tuple[Tensor, ...]:
        """Evaluate Z, and keep it for the adjoint."""
        ctx.called, ctx.kind = (recording, numbers(Z)), Z.new_empty(0)
        value, found = recording.forward(ctx.called[1])
        return tuple(like(Z, part) for part in (value, *found.values()))

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *adjoints: Tensor) -> tuple[Tensor, None]:
        """Return the adjoint of Z."""
        recording, rows = ctx.called
        value, *found = map(numbers, adjoints)
        return like(ctx.kind, recording.pull(rows, value, dict(zip(recording.quantities, found, strict=True)))), None


class StepFunction(torch.autograd.Function):
    """A step; its adjoint evaluates the step again."""

    @staticmethod
    def forward(
        ctx: Any, state: Tensor, action: Tensor, inputs: Tensor | None, step: CompiledStep
    ) -> tuple[Tensor, ...]:
        """Take the step, and keep its arguments for the adjoint."""
        given = None if inputs is None else numbers(inputs)
        ctx.called = step, numbers(state), numbers(action), given
        ctx.kinds = [None if each is None else each.new_empty(0) for each in (state, action, inputs)]
        after, observation, cost = step(*ctx.called[1:])
        return like(state, after), like(action, observation), like(action, cost)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *adjoints: Tensor) -> tuple[Tensor | None, ...]:
        """Return the adjoints of state, action and inputs."""
        step, state, action, given = ctx.called
        slopes = step.pull(state, action, *(numbers(adjoint) for adjoint in adjoints), inputs=given)
        back = (None if kind is None else like(kind, slope) for kind, slope in zip(ctx.kinds, slopes, strict=True))
        return (*back, None)


def numbers(tensor: Tensor) -> Array:
    """Copy a tensor to the host, in double precision."""
    return np.asarray(tensor.detach().cpu().numpy(), np.float64)


def like(tensor: Tensor, values: ArrayLike) -> Tensor:
    """Return numbers as a tensor with the precision and the device of another."""
    return torch.as_tensor(np.asarray(values), dtype=tensor.dtype, device=tensor.device)
