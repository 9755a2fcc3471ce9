"""Rollouts and steps as differentiable functions of JAX arrays; needs the extra ``jax``.

Batches go to the compiled kernels by a callback to the host, in double precision, under ``jit``, ``grad`` and ``vmap``
alike. Gradients are those of the kernels; they cannot be differentiated again, nor forwards.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symphys.api.compiled import CompiledRollout, CompiledStep, compile, compile_step
from symphys.errors import SymphysError, install_advice
from symphys.problem.problem import Source
from symphys.transcription.open_step import StepResult, StepStart
from symphys.transcription.recorded_rollout import RecordedRollout

try:
    import jax
    import jax.numpy as jnp
except ImportError as error:
    raise ImportError(f"symphys.jax needs JAX: {install_advice('jax')}") from error

Array = Any
"""jax.Array"""


def rollout(problem: Source, *quantities: str, smoothing: float = 0.0, backend: str = "auto") -> JaxRollout:
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
        >>> import jax, symphys.jax
        >>> jax.config.update("jax_enable_x64", True)
        >>> rollout = symphys.jax.rollout("ball_throw")
        >>> Z = jax.numpy.tile(rollout.z(throw=[8, 0, 3]), (4, 1))
        >>> jax.grad(lambda Z: rollout(Z).sum())(Z).shape
        (4, 6)
    """
    return JaxRollout(problem, *quantities, smoothing=smoothing, backend=backend)


def step(problem: Source, controllers: Sequence[str] | None = None, **options: Any) -> JaxStep:
    """Compile one time step with the commands open, for batches of states and actions.

    Args:
        problem: what ``symphys.load`` takes.
        controllers: names of the controllers that actions replace, as in ``symphys.compile_step``.
        options: further arguments of ``symphys.compile_step``.

    Raises:
        SymphysError: as ``symphys.compile_step``.

    Example:
        >>> import jax, symphys.jax
        >>> jax.config.update("jax_enable_x64", True)
        >>> step = symphys.jax.step("cart_pole")
        >>> state, observation, inputs = step.start(4)
        >>> cost = lambda action: step(state, action).cost.sum()
        >>> jax.jit(jax.grad(cost))(jax.numpy.ones((4, step.action_size))).shape
        (4, 1)
    """
    return JaxStep(problem, controllers, **options)


class JaxRollout:
    """A problem's rollout as a differentiable function of Z (B, n): values, and quantities over time.

    Attributes:
        compiled: the rollout on numpy arrays.
        recording: the rollout with its quantities; None without quantities.
    """

    def __init__(self, problem: Source, *quantities: str, smoothing: float = 0.0, backend: str = "auto") -> None:
        """Compile the rollout; the arguments are those of ``rollout``."""
        require_double()
        self.compiled: CompiledRollout = compile(problem, smoothing, backend)
        self.recording = self.compiled.recording(*quantities) if quantities else None

    def z(self, values: Mapping[str, ArrayLike] | None = None, /, **variables: ArrayLike) -> Array:
        """Return the guess as a decision vector (n,), with some variables replaced by name."""
        return jnp.asarray(self.compiled.z(values, **variables))

    def __call__(self, Z: Array) -> Any:
        """Return the values (B,) of Z (B, n); with quantities also each of these (B, N, k), at the ends of steps."""
        rows = jnp.asarray(Z, np.float64)
        return rollout_value(self.compiled, rows) if self.recording is None else recorded_value(self.recording, rows)


class JaxStep:
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
        require_double()
        self.compiled: CompiledStep = compile_step(problem, controllers, **options)
        self.state_size, self.action_size = self.compiled.state_size, self.compiled.action_size
        self.observation_size, self.steps = self.compiled.observation_size, self.compiled.steps

    def start(self, count: int = 1, seed: int | None = None) -> StepStart:
        """Return the states (B, s), observations (B, o) and inputs (B, N, i) with which motions start.

        Args:
            count: the number B of motions.
            seed: seed of the samples of scenarios; None: the problem's own, ``count`` times.
        """
        return StepStart(*(jnp.asarray(part) for part in self.compiled.start(count, seed)))

    def __call__(self, state: Array, action: Array, inputs: Array | None = None) -> StepResult:
        """Return state and observation after a step, and its cost; gradients flow to all three arguments.

        Args:
            state: (B, s).
            action: (B, m).
            inputs: (B, i) forces and commands that act as well, ``start.inputs[:, k]``; None: those of the guess at
                the time of the state.
        """
        given = None if inputs is None else jnp.asarray(inputs, np.float64)
        return StepResult(*step_value(self.compiled, jnp.asarray(state), jnp.asarray(action, np.float64), given))


def require_double() -> None:
    """Raise SymphysError if JAX computes in single precision."""
    if not jax.config.jax_enable_x64:
        text = 'JAX is set to single precision; say jax.config.update("jax_enable_x64", True) first'
        raise SymphysError(f"symphys.jax computes in double precision: {text}")


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def rollout_value(compiled: CompiledRollout, Z: Array) -> Array:
    """Evaluate the values (...,) of Z (..., n) on the host."""
    return on_host(lambda rows: (compiled.value(rows),), [Z], [()])[0]


def rollout_forward(compiled: CompiledRollout, Z: Array) -> tuple[Array, Array]:
    """Evaluate the values, and the gradients for the backward pass."""
    value, slope = on_host(compiled.value_and_gradient, [Z], [(), (compiled.n,)])
    return value, slope


def rollout_backward(_compiled: CompiledRollout, slope: Array, adjoint: Array) -> tuple[Array]:
    """Return the adjoint of Z."""
    return (adjoint[..., None] * slope,)


rollout_value.defvjp(rollout_forward, rollout_backward)


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def recorded_value(recording: RecordedRollout, Z: Array) -> tuple[Array, ...]:
    """Evaluate the values and the quantities (..., N, k) of Z (..., n) on the host."""

    def called(rows: Any) -> tuple[Any, ...]:
        value, found = recording.forward(rows)
        return (value, *found.values())

    return on_host(called, [Z], [(), *((recording.steps, size) for size in recording.quantities.values())])


def recorded_forward(recording: RecordedRollout, Z: Array) -> tuple[tuple[Array, ...], Array]:
    """Evaluate values and quantities; keep Z for the backward pass."""
    return recorded_value(recording, Z), Z


def recorded_backward(recording: RecordedRollout, Z: Array, adjoints: tuple[Array, ...]) -> tuple[Array]:
    """Return the adjoint of Z."""

    def pulled(rows: Any, value: Any, *found: Any) -> tuple[Any]:
        return (recording.pull(rows, value, dict(zip(recording.quantities, found, strict=True))),)

    return (on_host(pulled, [Z, *adjoints], [Z.shape[-1:]])[0],)


recorded_value.defvjp(recorded_forward, recorded_backward)


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def step_value(step: CompiledStep, state: Array, action: Array, inputs: Array | None) -> tuple[Array, ...]:
    """Take the step on the host."""
    called = [state, action] if inputs is None else [state, action, inputs]
    return on_host(lambda *rows: tuple(step(*rows)), called, [(step.state_size,), (step.observation_size,), ()])


def step_forward(
    step: CompiledStep, state: Array, action: Array, inputs: Array | None
) -> tuple[tuple[Array, ...], tuple[Array, Array, Array | None]]:
    """Take the step; keep its arguments for the backward pass."""
    return step_value(step, state, action, inputs), (state, action, inputs)


def step_backward(step: CompiledStep, called: tuple[Array, ...], adjoints: tuple[Array, ...]) -> tuple[Array, ...]:
    """Return the adjoints of state, action and inputs."""
    state, action, inputs = called
    rows = [state, action, *adjoints] + ([] if inputs is None else [inputs])
    sizes = [(step.state_size,), (step.action_size,), (step.input_size,)]
    slopes = on_host(step.pull, rows, sizes)
    return (*slopes[:2], None if inputs is None else slopes[2])


step_value.defvjp(step_forward, step_backward)


def on_host(function: Any, arguments: Sequence[Array], sizes: Sequence[tuple[int, ...]]) -> tuple[Array, ...]:
    """Call a function of batches on the host, with all leading axes flattened into one batch axis.

    Args:
        function: a function of arrays (B, k) or (B, N, k) that returns a tuple of arrays with the same first axis.
        arguments: arrays (..., k); the first sets the leading axes.
        sizes: shapes of the results behind the leading axes: (k,), or () for numbers.
    """
    batch = arguments[0].shape[:-1]

    def called(*given: Any) -> tuple[Any, ...]:
        lead = np.shape(given[0])[:-1]
        rows = [np.reshape(each, (-1, *np.shape(each)[len(lead) :])) for each in map(np.asarray, given)]
        return tuple(np.reshape(part, (*lead, *size)) for part, size in zip(function(*rows), sizes, strict=True))

    results = tuple(jax.ShapeDtypeStruct((*batch, *size), np.float64) for size in sizes)
    found: tuple[Array, ...] = jax.pure_callback(called, results, *arguments, vmap_method="broadcast_all")
    return found
