"""Gymnasium environments of any problem with controllers, motors or inputs; needs the extra ``env``.

Actions take the place of the controllers' outputs, and observations are the readings of sensors. The reward of a step
is minus its cost, so that the return of an episode is minus the objective. If the problem's [termination] ends a motion
early, the costs of the remaining time are in the last reward. Each episode draws a sample of the [[scenario]] tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symphys.api.compiled import CompiledStep, compile_step
from symphys.errors import SymphysError, install_advice
from symphys.problem.problem import Source
from symphys.types import Array

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.vector.utils import batch_space
except ImportError as error:
    raise ImportError(f"symphys.env needs Gymnasium: {install_advice('env')}") from error

Info = dict[str, Any]


class Motions:
    """A batch of motions, each at its own time.

    Attributes:
        step: the step that advances them.
        randomized: whether motions start in samples of the problem's [[scenario]] tables.
        state: (B, s) the states.
        observation: (B, o) their observations.
    """

    def __init__(self, step: CompiledStep, count: int, randomized: bool) -> None:
        """Put ``count`` motions at the start of the guess."""
        self.step, self.randomized = step, randomized
        self.state, self.observation, self._inputs = step.start(count)

    def begin(self, which: NDArray[np.bool_], rng: np.random.Generator) -> None:
        """Restart some motions, selected by ``which`` (B,)."""
        count = int(which.sum())
        if self.randomized:  # the first sample is always the problem's own
            parts = [part[1:] for part in self.step.start(count + 1, int(rng.integers(2**31)))]
        else:
            parts = list(self.step.start(count))
        self.state[which], self.observation[which], self._inputs[which] = parts

    def advance(self, actions: Array) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Take a step with actions (B, m).

        Returns:
            Rewards (B,), which motions were terminated (B,), and which of the others reached their last step (B,).

        Raises:
            SymphysError: a state is not finite; names the motion, the step and the quantity.
        """
        ticks = np.minimum(self.step.tick(self.state), self.step.steps - 1)
        inputs = self._inputs[np.arange(len(ticks)), ticks]
        self.state, self.observation, cost = self.step(self.state, actions, inputs)
        self._require_finite(ticks)
        over = ~self.step.alive(self.state)
        if over.any():
            cost[over] += self.step.rest(self.state[over])
        return -cost, over, ~over & (self.step.tick(self.state) >= self.step.steps)

    def _require_finite(self, ticks: NDArray[np.int64]) -> None:
        if not (broken := ~np.isfinite(self.state).all(axis=1)).any():
            return
        row = int(np.argmax(broken))
        names = [name for name, part in self.step.columns.items() if not np.isfinite(self.state[row, part]).all()]
        text = f"{', '.join(names) or 'its state'} not finite after step {ticks[row] + 1}"
        raise SymphysError(f"{self.step.problem.name}, environment {row}: {text}")


class VectorEnv(gymnasium.vector.VectorEnv):
    """A batch of motions of a problem; an episode that has ended restarts with the next step.

    Attributes:
        motions: the states of the motions.

    Example:
        >>> import symphys.env
        >>> env = symphys.env.VectorEnv("cart_pole", num_envs=8)
        >>> observation, info = env.reset(seed=0)
        >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        >>> observation.shape, reward.shape
        ((8, 26), (8,))
    """

    metadata: ClassVar[Info] = {"render_modes": [], "autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        problem: Source,
        num_envs: int = 1,
        controllers: Sequence[str] | None = None,
        randomized: bool = True,
        **options: Any,
    ) -> None:
        """Compile the step.

        Args:
            problem: what ``symphys.load`` takes.
            num_envs: the number B of motions.
            controllers: names of the controllers that actions replace, as in ``symphys.compile_step``.
            randomized: whether episodes are samples of the problem's [[scenario]] tables.
            options: further arguments of ``symphys.compile_step``.
        """
        step = compile_step(problem, controllers, **options)
        self.num_envs, self.motions = num_envs, Motions(step, num_envs, randomized)
        self.single_observation_space, self.single_action_space = spaces(step)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._ended = np.zeros(num_envs, bool)

    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[Any, Info]:
        """Restart all episodes; return the observations (B, o)."""
        super().reset(seed=seed, options=options)
        self._ended[:] = False
        self.motions.begin(np.ones(self.num_envs, bool), self.np_random)
        return observed(self.motions.observation), {}

    def step(self, actions: ArrayLike) -> tuple[Any, Array, Any, Any, Info]:
        """Take a step; return observations (B, o), rewards (B,), terminated (B,), truncated (B,) and no info."""
        again = self._ended
        rewards, over, late = self.motions.advance(np.asarray(actions, float))
        if again.any():
            self.motions.begin(again, self.np_random)
            rewards[again], over[again], late[again] = 0.0, False, False
        self._ended = over | late
        return observed(self.motions.observation), rewards, over, late, {}


class Env(gymnasium.Env):
    """One motion of a problem.

    Example:
        >>> import symphys.env
        >>> env = symphys.env.Env("cart_pole")
        >>> observation, info = env.reset(seed=0)
        >>> observation, reward, terminated, truncated, info = env.step([1.0])
        >>> observation.shape, truncated
        ((26,), False)
    """

    metadata: ClassVar[Info] = {"render_modes": []}

    def __init__(
        self, problem: Source, controllers: Sequence[str] | None = None, randomized: bool = True, **options: Any
    ) -> None:
        """Compile the step; the arguments are those of ``VectorEnv``."""
        step = compile_step(problem, controllers, **options)
        self.motions = Motions(step, 1, randomized)
        self.observation_space, self.action_space = spaces(step)

    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[Any, Info]:
        """Restart the episode; return the observation (o,)."""
        super().reset(seed=seed, options=options)
        self.motions.begin(np.ones(1, bool), self.np_random)
        return observed(self.motions.observation[0]), {}

    def step(self, action: ArrayLike) -> tuple[Any, float, bool, bool, Info]:
        """Take a step; return the observation (o,), the reward, terminated, truncated and no info."""
        (reward,), (over,), (late,) = self.motions.advance(np.asarray(action, float)[None])
        return observed(self.motions.observation[0]), float(reward), bool(over), bool(late), {}


def spaces(step: CompiledStep) -> tuple[Any, Any]:
    """Return the spaces of observations (o,) and actions (m,), in single precision as agents use it."""
    unbounded = np.full(step.observation_size, np.inf)
    return (
        Box(observed(-unbounded), observed(unbounded), dtype=np.float32),
        Box(observed(step.lower), observed(step.upper), dtype=np.float32),
    )


def observed(values: Array) -> NDArray[np.float32]:
    """Convert to single precision."""
    return values.astype(np.float32)
