"""Rollouts and single steps of a problem, compiled for batches, with gradients."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from symphys.api.transcriptions import linearized, recorded, stepped, transcribed
from symphys.api.values import by_name, vector
from symphys.codegen.backends import NAMES, require_backend
from symphys.codegen.backends.precision import warn
from symphys.errors import SymphysError
from symphys.problem import Problem
from symphys.problem.problem import Source, load
from symphys.records import dataclass
from symphys.shooting import Evaluator, Linearized, Values
from symphys.trajectory import Trajectory
from symphys.transcription import Transcription
from symphys.transcription.open_step import CompiledStep as CompiledStep
from symphys.types import Array

if TYPE_CHECKING:
    from symphys.transcription.recorded_rollout import RecordedRollout


@dataclass(frozen=True, eq=False)
class CompiledRollout:
    """A problem's rollout for batches of decision vectors Z (B, n), or for one z (n,).

    The value of z is what solvers minimise: the objective, plus a penalty for constraints that are violated. Rows do
    not depend on each other; a rollout that is not finite gives a row that is not finite.

    Attributes:
        problem: the problem that is rolled out.
        smoothing: width of the smoothed contact laws [m/s]; 0 is the exact law.
    """

    problem: Problem
    smoothing: float
    _made: Transcription
    _settings: tuple[str, int | None]

    @property
    def n(self) -> int:
        """The number n of decision variables, the length of z."""
        return self._made.shooting.n

    @property
    def backend(self) -> str:
        """A description of the backend that evaluates."""
        return str(self._made.backend)

    def finish(self) -> None:
        """Wait for the compiler. Until it is done, an interpreter evaluates large problems, with identical results."""
        self._made.backend.finish()

    def z(self, values: Mapping[str, ArrayLike] | None = None, /, **variables: ArrayLike) -> Array:
        """Return the guess as a decision vector (n,), with some variables replaced by name."""
        return vector(self._made.shooting, {**(values or {}), **variables})

    def values(self, z: ArrayLike) -> dict[str, Array]:
        """Split z (n,) into variables by name: (components,), or (knots, components) of those with several knots."""
        return by_name(self._made.shooting, np.asarray(z, float))

    def value(self, Z: ArrayLike) -> Array:
        """Return the values (B,) of Z (B, n), or () of one z (n,)."""
        batch, single = rows(Z, self.n)
        return np.asarray(first(self._evaluator.value(batch, self.smoothing).merit, single))

    def gradient(self, Z: ArrayLike) -> Array:
        """Return the gradients of the values: (B, n), or (n,) of one z."""
        return self.value_and_gradient(Z)[1]

    def value_and_gradient(self, Z: ArrayLike) -> tuple[Array, Array]:
        """Return values (B,) and gradients (B, n) at the cost of the gradients alone."""
        batch, single = rows(Z, self.n)
        found = self._evaluator.gradient(batch, self.smoothing)
        warn(self.problem.name, self._made.backend.doubt())
        return np.asarray(first(found.merit, single)), np.asarray(first(found.gradient, single))

    def residuals(self, Z: ArrayLike) -> Array:
        """Return the residuals (B, m), or (m,), whose squares sum to the value.

        Raises:
            SymphysError: the value is no sum of squares.
        """
        self._require_squares()
        batch, single = rows(Z, self.n)
        return np.asarray(first(self._evaluator.residuals(batch, self.smoothing).residuals, single))

    def jacobian(self, Z: ArrayLike) -> Array:
        """Return the Jacobians of the residuals: (B, m, n), or (m, n) of one z.

        Raises:
            SymphysError: the value is no sum of squares.
        """
        self._require_squares()
        batch, single = rows(Z, self.n)
        jacobian = self._evaluator.jacobian(batch, self.smoothing).jacobian
        warn(self.problem.name, self._made.backend.doubt())
        return np.asarray(first(jacobian, single))

    def evaluate(self, Z: ArrayLike) -> Values:
        """Return all values: ``objective`` (B,), ``errors`` (B, k) as error / tolerance, ``outputs`` (B, o), ..."""
        return self._evaluator.value(rows(Z, self.n)[0], self.smoothing)

    def recording(self, *quantities: str) -> RecordedRollout:
        """Compile the rollout with quantities over time as outputs, and their adjoints.

        Args:
            quantities: formulas as in problem files: ``ball.position``, ``rotate(torso.orientation, [0, 0, 1])``.

        Returns:
            A kernel with ``forward(Z)``: values (B,) and quantities (B, N, k); and with ``pull``, which takes adjoints
            of them back to Z (B, n).

        Example:
            >>> import numpy as np, symphys
            >>> recording = symphys.compile("ball_throw").recording("ball.position")
            >>> value, found = recording.forward(np.tile([8, 0, 3, 0, 0, 0.0], (4, 1)))
            >>> found["ball.position"].shape  # at the ends of all steps
            (4, 500, 3)
        """
        return recorded(self.problem, quantities, self.smoothing, *self._settings)

    def linearize(self, z: ArrayLike) -> Linearized:
        """Linearise each step of the motion of one z (n,) in its state, its inputs and the static entries of z.

        States vary in their tangent space of dimension t: coordinates and rates of robots, and the forces that warm
        start a step, so that products of ``a`` are exact. Static entries of z are those of variables that are no
        controls, in their order. ``c`` of the first step includes their effect on the first state outside the tangent.

        Returns:
            ``a`` (N, t, t), ``b`` (N, t, m) and ``c`` (N, t, s): derivatives of the next state by the state, the inputs
            and the static entries; and ``start`` (t, s): those of the first state by the static entries.

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
        """Simulate one z (n,).

        Raises:
            NotFinite: a number of the motion is not finite; names the time step and the body.
        """
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
    """Compile a problem's rollout for batches of decision vectors.

    Args:
        problem: any argument of ``load``.
        smoothing: width of the smoothed contact laws [m/s]; 0 is the exact law.
        backend: the evaluator: "auto", "simd", "simd32", "c", "cuda", "cuda32" or "casadi".
        threads: number of threads that share a batch; None: one for each processor.

    Raises:
        ProblemError: the problem cannot be used.
        SymphysError: there is no such backend.

    Example:
        >>> import numpy as np, symphys
        >>> rollout = symphys.compile("ball_throw", backend="casadi")
        >>> Z = rollout.z(throw=[8, 0, 3]) + 0.1 * np.random.default_rng(0).standard_normal((4, rollout.n))
        >>> rollout.value(Z).shape, rollout.gradient(Z).shape
        ((4,), (4, 6))
    """
    require_backend(backend)
    read = load(problem)
    made = transcribed(read, smoothing == 0, backend, threads)
    _ = made.backend  # it is built when it is asked for, which is now
    return CompiledRollout(read, smoothing, made, (backend, threads))


def compile_step(
    problem: Source,
    controllers: Sequence[str] | None = None,
    *,
    sensors: Sequence[str] | None = None,
    smoothing: float = 0.0,
    backend: str = "auto",
    threads: int | None = None,
) -> CompiledStep:
    """Compile one time step of a problem for batches of states, with actions in place of its controllers.

    An action is what a controller would output, before its ``scale``: commands of motors, or forces. The other
    controllers, and inputs that variables set over time, still act. Observations are the readings of sensors.

    Args:
        problem: any argument of ``load``.
        controllers: names of the controllers that actions replace. None: those whose numbers a variable sets, or else
            all; without controllers the inputs that variables set over time; without these the commands of all motors.
        sensors: names of the sensors that are observed. None: those of these controllers, or else all; without sensors
            the positions, orientations and velocities of all bodies.
        smoothing: width of the smoothed contact laws [m/s]; 0 is the exact law.
        backend: the evaluator: "auto", "simd", "simd32", "cuda", "cuda32" or "casadi". The first adjoints of a step in
            single precision are compared with double precision; those of a chain of steps are not, and may be far off.
        threads: number of threads that share a batch; None: one for each processor.

    Raises:
        SymphysError: there is no such controller, sensor or backend, or nothing that could act.
        ProblemError: a cost depends on the numbers of a controller that actions replace.

    Example:
        >>> import numpy as np, symphys
        >>> step = symphys.compile_step("cart_pole", backend="casadi")
        >>> state, observation, inputs = step.start(4)
        >>> state, observation, cost = step(state, np.ones((4, step.action_size)))
        >>> step.actions, cost.shape
        (('rail.command',), (4,))
    """
    require_backend(backend, [name for name in NAMES if name != "c"])
    named, read = (None if names is None else tuple(names) for names in (controllers, sensors))
    return stepped(load(problem), named, read, smoothing, backend, threads)


def rows(Z: ArrayLike, n: int) -> tuple[Array, bool]:
    """Return Z as rows (B, n), and whether it was one z (n,); ValueError for other shapes."""
    array = np.asarray(Z, float)
    if array.ndim not in (1, 2) or array.shape[-1] != n:
        raise ValueError(f"Z must be (batch, {n}) or ({n},), not {array.shape}")
    return (array[None], True) if array.ndim == 1 else (array, False)


def first(found: Array | None, single: bool) -> Array:
    """Return the rows, or the only row of one z."""
    assert found is not None
    return found[0] if single else found
