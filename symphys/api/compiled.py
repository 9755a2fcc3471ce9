"""Batches of rollouts, with gradients, from a compiled kernel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from symphys.api.transcriptions import linearized, recorded, transcribed
from symphys.api.values import by_name, vector
from symphys.codegen.backends import require_backend
from symphys.codegen.backends.precision import warn
from symphys.errors import SymphysError
from symphys.problem import Problem
from symphys.problem.loading import Source, load
from symphys.shooting import Evaluator, Linearized, Values
from symphys.trajectory import Trajectory
from symphys.transcription import Transcription
from symphys.types import Array

if TYPE_CHECKING:
    from symphys.transcription.recorded_rollout import RecordedRollout


@dataclass(frozen=True, eq=False)
class CompiledRollout:
    """A problem's rollout for batches of decision vectors Z (B, n), or for one z (n,).

    The value of z is the objective, and with constraints the penalty of those that are violated: what solvers lower.
    Rows do not depend on each other. A rollout that is not finite is a row that is not finite.

    Attributes:
        problem: what is rolled out.
        smoothing: of the contacts [m/s].
    """

    problem: Problem
    smoothing: float
    _made: Transcription
    _settings: tuple[str, int | None]

    @property
    def n(self) -> int:
        """The length of z."""
        return self._made.shooting.n

    @property
    def backend(self) -> str:
        """What evaluates, in words."""
        return str(self._made.backend)

    def finish(self) -> None:
        """Wait for the compiler: a first start of a large problem begins on an interpreter, with the same bits."""
        self._made.backend.finish()

    def z(self, values: Mapping[str, ArrayLike] | None = None, /, **variables: ArrayLike) -> Array:
        """(n,): the guess, with some variables replaced by name."""
        return vector(self._made.shooting, {**(values or {}), **variables})

    def values(self, z: ArrayLike) -> dict[str, Array]:
        """The parts of z (n,) by the names of variables: (components,), or (knots, components) with several knots."""
        return by_name(self._made.shooting, np.asarray(z, float))

    def value(self, Z: ArrayLike) -> Array:
        """(B,), or () for one z."""
        batch, single = rows(Z, self.n)
        return np.asarray(first(self._evaluator.value(batch, self.smoothing).merit, single))

    def gradient(self, Z: ArrayLike) -> Array:
        """(B, n), or (n,) for one z: the gradient of the value."""
        return self.value_and_gradient(Z)[1]

    def value_and_gradient(self, Z: ArrayLike) -> tuple[Array, Array]:
        """Both, at the cost of the gradient."""
        batch, single = rows(Z, self.n)
        found = self._evaluator.gradient(batch, self.smoothing)
        warn(self.problem.name, self._made.backend.doubt())
        return np.asarray(first(found.merit, single)), np.asarray(first(found.gradient, single))

    def residuals(self, Z: ArrayLike) -> Array:
        """(B, m), or (m,): what is squared and summed in the value; SymphysError where it is no such sum."""
        self._require_squares()
        batch, single = rows(Z, self.n)
        return np.asarray(first(self._evaluator.residuals(batch, self.smoothing).residuals, single))

    def jacobian(self, Z: ArrayLike) -> Array:
        """(B, m, n), or (m, n): of the residuals; SymphysError where there are none."""
        self._require_squares()
        batch, single = rows(Z, self.n)
        jacobian = self._evaluator.jacobian(batch, self.smoothing).jacobian
        warn(self.problem.name, self._made.backend.doubt())
        return np.asarray(first(jacobian, single))

    def evaluate(self, Z: ArrayLike) -> Values:
        """All that a rollout gives: ``objective`` (B,), ``errors`` (B, k) as error / tolerance, ``outputs`` (B, o)."""
        return self._evaluator.value(rows(Z, self.n)[0], self.smoothing)

    def recording(self, *quantities: str) -> RecordedRollout:
        """The rollout as a kernel that gives quantities over time, and takes adjoints of them back to Z.

        Args:
            quantities: formulas as in problem files: ``ball.position``, ``rotate(torso.orientation, [0, 0, 1])``.

        Example:
            >>> import numpy as np, symphys
            >>> recording = symphys.compile("ball_throw").recording("ball.position")
            >>> value, found = recording.forward(np.tile([8, 0, 3, 0, 0, 0.0], (4, 1)))
            >>> found["ball.position"].shape  # at the ends of all steps
            (4, 500, 3)
        """
        return recorded(self.problem, quantities, self.smoothing, *self._settings)

    def linearize(self, z: ArrayLike) -> Linearized:
        """How each step of the motion of one z (n,) changes with its state, its inputs and the static entries of z.

        Changes of states are tangents: coordinates and rates of robots, and the forces that steps begin from, so that
        products of ``a`` are exact. Static entries of z are those of variables that are no controls, in their
        order. ``c`` of the first step has also what these do to the first state beside its tangent.

        Returns:
            ``a`` (N, t, t), ``b`` (N, t, m) and ``c`` (N, t, s): the next state by the state, the inputs and the static
            entries; and ``start`` (t, s): the first state by the static entries.

        Example:
            >>> import symphys
            >>> rollout = symphys.compile("ball_throw")
            >>> slopes = rollout.linearize(rollout.z())
            >>> slopes.a.shape, slopes.b.shape, slopes.c.shape, slopes.start.shape
            ((500, 18, 18), (500, 18, 0), (500, 18, 6), (18, 6))
        """
        made = linearized(self.problem, self.smoothing == 0, *self._settings)
        return made.linearize(made.motion(np.asarray(z, float), self.smoothing))

    def trajectory(self, z: ArrayLike) -> Trajectory:
        """The motion of one z (n,); NotFinite if there is none."""
        return self._made.simulate(np.asarray(z, float), self.smoothing)

    def _require_squares(self) -> None:
        if not self._made.shooting.squares:
            text = "its value is no sum of squares, so it has no residuals; ask for `value` and `gradient`"
            raise SymphysError(f"{self.problem.name}: {text}")

    @property
    def _evaluator(self) -> Evaluator:
        return self._made.shooting.evaluator


def compile(
    problem: Source, smoothing: float = 0.0, backend: str = "auto", threads: int | None = None
) -> CompiledRollout:
    """A problem's rollout, compiled for batches.

    Args:
        problem: what ``load`` takes.
        smoothing: of the contacts [m/s]; 0 is the exact contact law.
        backend: what evaluates: "auto", "simd", "simd32", "c", "cuda", "cuda32" or "casadi".
        threads: that share a batch; None: one for each processor.

    Example:
        >>> import numpy as np, symphys
        >>> rollout = symphys.compile("ball_throw", backend="casadi")
        >>> Z = rollout.z(throw=[8, 0, 3]) + 0.1 * np.random.default_rng(0).standard_normal((4, rollout.n))
        >>> rollout.value(Z).shape, rollout.gradient(Z).shape
        ((4,), (4, 6))
    """
    require_backend(backend)
    read = load(problem)
    return CompiledRollout(read, smoothing, transcribed(read, smoothing == 0, backend, threads), (backend, threads))


def rows(Z: ArrayLike, n: int) -> tuple[Array, bool]:
    """(B, n), and whether it was one z; ValueError, which names the shape that fits."""
    array = np.asarray(Z, float)
    if array.ndim not in (1, 2) or array.shape[-1] != n:
        raise ValueError(f"Z must be (batch, {n}) or ({n},), not {array.shape}")
    return (array[None], True) if array.ndim == 1 else (array, False)


def first(found: Array | None, single: bool) -> Array:
    """The rows, or the only one."""
    assert found is not None
    return found[0] if single else found
