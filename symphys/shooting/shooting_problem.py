"""The shooting problem: what a solver minimises, evaluated for batches of decision vectors z."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, Protocol

import numpy as np

from symphys.records import dataclass
from symphys.shooting.staged_problem import StagedProblem
from symphys.types import Array, Ints

Function = Any
"""casadi.Function"""
GuessedStates = Callable[[Array, Ints, float], Array]
"""The type of ``ShootingProblem.guessed_states``."""
Measure = Callable[[Array, Array], Array]
"""The type of ``ShootingProblem.measure``."""


@dataclass(frozen=True)
class VariableBlock:
    """One named part of z, flattened knot after knot.

    Attributes:
        name: the variable's name in the problem file.
        start: index of its first entry in z.
        shape: (components, knots).
        guess, lower, upper, scale, spread: (components * knots,); ``scale`` is the size of a typical change,
            ``spread`` the standard deviation with which a seed perturbs the guess.
    """

    name: str
    start: int
    shape: tuple[int, int]
    guess: Array
    lower: Array
    upper: Array
    scale: Array
    spread: Array

    @property
    def stop(self) -> int:
        """Return one past the index of its last entry in z."""
        return self.start + self.shape[0] * self.shape[1]


@dataclass(frozen=True)
class Values:
    """Results of an evaluation of Z (batch, n), row by row.

    Attributes:
        merit, objective: (batch,).
        errors: (batch, k).
        outputs: (batch, o) see ``ShootingProblem.output_names``; None: the problem has none.
        gradient: (batch, n) of the merit; None where it was not asked for.
        residuals, jacobian: (batch, m) and (batch, m, n), merit = r . r; None where they were not asked for.
        probe: (batch,) the number whose gradient is examined; None where it is not computed.
        alive: (batch,) 1 where the motion lasted to its end, 0 where it was over before; None where all do.
    """

    merit: Array
    objective: Array
    errors: Array
    outputs: Array | None = None
    gradient: Array | None = None
    residuals: Array | None = None
    jacobian: Array | None = None
    probe: Array | None = None
    alive: Array | None = None


class Evaluator(Protocol):
    """Evaluates Z (batch, n) at one smoothing; a row's numbers do not depend on the other rows.

    A simulation that is not finite is a row that is not finite; RuntimeError where nothing could be evaluated.
    """

    def value(self, Z: Array, smoothing: float) -> Values:
        """Return merits, objectives, errors, outputs."""
        ...

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Return the same and the gradients of the merits."""
        ...

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """Return the residuals, too; only where the problem has ``squares``."""
        ...

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """Return the residuals and their Jacobians, too; only where the problem has ``squares``."""
        ...


class StepwiseEvaluator(Evaluator, Protocol):
    """An ``Evaluator`` that takes one step after the other."""

    def along(self, Z: Array, X: Array) -> Values:
        """Return the values of motions of Z (batch, n) whose states X (batch, N + 1, nx) are known."""
        ...


class LaterEvaluator:
    """An ``Evaluator`` that is made when it is first asked for values."""

    def __init__(self, make: Callable[[], Evaluator]) -> None:
        """Keep ``make``, which returns the same evaluator whenever it is called."""
        self.make = make

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        return self.make().value(Z, smoothing)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``."""
        return self.make().gradient(Z, smoothing)

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.residuals``."""
        return self.make().residuals(Z, smoothing)

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.jacobian``."""
        return self.make().jacobian(Z, smoothing)


class WithoutResiduals:
    """The half of ``Evaluator`` that problems without ``squares`` lack."""

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """Raise: a problem without ``ShootingProblem.squares`` has no residuals."""
        raise NotImplementedError("this problem has no residuals")

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """Raise: a problem without ``ShootingProblem.squares`` has no Jacobian."""
        raise NotImplementedError("this problem has no residuals to differentiate")


@dataclass(frozen=True)
class ScenarioSamples:
    """Samples of the problem's scenarios, one a row.

    Attributes:
        grid: the number of the discretisation.
        numbers: (batch, s) all that differs between samples.
    """

    grid: int
    numbers: Array


class ScenarioEvaluator(Protocol):
    """Draws samples of the problem's scenarios (domain randomization), and evaluates points in them.

    Samples differ in friction, masses, start pose, pushes: in what the [[scenario]] tables vary.

    Attributes:
        grids: what the discretisations are called; the first is that of the problem.
    """

    grids: tuple[str, ...]

    def draw(self, rng: np.random.Generator, count: int, width: float = 1.0, grid: int = 0) -> ScenarioSamples:
        """Draw ``count`` samples: first the problem's own, then others, ``width`` times as wide as its tables.

        The same stream gives the same samples on every grid.
        """
        ...

    def value(self, Z: Array, samples: ScenarioSamples, smoothing: float, /) -> Values:
        """Return merits, objectives, errors and alive at Z (batch, n), or (1, n) for all."""
        ...

    def gradient(
        self,
        Z: Array,
        samples: ScenarioSamples,
        smoothing: float,
        /,
        adjoint_discount: float = 0.0,
        horizon: float = math.inf,
    ) -> Values:
        """Return the same and the gradients of the merits.

        With ``adjoint_discount`` [1/s] above 0 the adjoint of the state decays like exp(-adjoint_discount t) on its way
        back, and ends where a motion was over: no derivative, but what descends where derivatives explode. After
        ``horizon`` [s] nothing moves, and what is summed over time is 0: what is computed takes so much less time.
        """
        ...


@dataclass(frozen=True)
class Nlp:
    """Objective and constraints for NLP solvers: casadi functions of (z, smoothing), to be called on symbols.

    Attributes:
        expression: -> (objective, constraints); can be differentiated as often as you like. None: there is none.
        value: -> (objective, constraints), compiled; None: use the expression.
        gradient: -> (objective, its gradient (n,)), compiled; None likewise.
        jacobian: -> (constraints, their Jacobian (m, n)), compiled; None likewise.
        keep: what the compiled functions need to live.
    """

    expression: Function
    value: Function | None = None
    gradient: Function | None = None
    jacobian: Function | None = None
    keep: object = None


class LaterNlp(Nlp):
    """An ``Nlp`` that is made when somebody asks for one of its functions: few solvers do."""

    def __init__(self, make: Callable[[], Nlp]) -> None:
        """Keep ``make``, which is called once."""
        object.__setattr__(self, "_make", make)

    def _part(self, name: str) -> Any:
        made = self.__dict__.get("_made")
        if made is None:
            made = self._make()  # type: ignore[attr-defined]
            object.__setattr__(self, "_made", made)
        return getattr(made, name)

    expression = property(lambda self: self._part("expression"))
    value = property(lambda self: self._part("value"))
    gradient = property(lambda self: self._part("gradient"))
    jacobian = property(lambda self: self._part("jacobian"))
    keep = property(lambda self: self._part("keep"))


@dataclass(frozen=True)
class ShootingProblem:
    """Minimise objective(z) within bounds and constraints.

    ``merit`` is the objective plus the quadratic penalty of violated constraints, for solvers without
    constraints; without constraints both are the same. ``errors`` holds one number per target, constraint and goal,
    divided by its tolerance: met where <= 1.

    Attributes:
        name: the problem's name.
        blocks: the parts of z, in order.
        evaluator: evaluates all of this for batches of z.
        nlp: objective and constraints for NLP solvers.
        squares: whether the merit is a sum of squared residuals; otherwise these cannot be asked for.
        constraint_names: one per entry of the constraints.
        constraint_lower, constraint_upper: (m,).
        limits: which of the errors are those of constraints.
        smoothing: of each stage, decreasing, at least one; each starts from the best point of the one before.
        stop_when_met: stop at the first point whose errors are all <= 1, instead of at a stationary point.
        output_names: of the reported quantities.
        scenario: evaluates points in samples of the problem's scenarios; None: it has none.
        staged: makes the problem as a chain of steps when it is first asked for; SymphysError where formulas look at
            more than one state. None: there is none, as of problems with scenarios.
        by_steps: evaluates by the steps of ``staged``, for solvers that compile no rollout; None: there is none.
        asking: (z (n,)) -> the steps of ``staged`` without forces, with targets and constraints weighted by their
            tolerances, and costs by so little that those of z count for a thousandth of a tolerance. None: nothing is
            asked for, or nobody can say.
        measure: (objectives (batch,), errors (batch, k)) -> (batch,) by which points are compared in place of their
            merits, for methods that take no gradient of these. None: by their merits.
        guessed_states: (z (n,), numbers (M,) of states from 1 on, smoothing) -> (M, nx) where the motion is guessed to
            pass. None: where the rollout of z leads.
        confirms: (z (n,)) -> whether what meets everything still does in finer simulations; None: nobody can say.
        finer_errors: (Z (B, n)) -> (B, k) the errors with finer time steps, each the largest, as shares of what refutes
            a result; None: nobody can say.
        multipliers: those that a solve of this or a like problem ended with where its guess is, see
            ``Outcome.multipliers``; empty where none are known.
    """

    name: str
    blocks: tuple[VariableBlock, ...]
    evaluator: Evaluator
    nlp: Nlp
    squares: bool
    constraint_names: tuple[str, ...] = ()
    constraint_lower: Array = field(default_factory=lambda: np.zeros(0))
    constraint_upper: Array = field(default_factory=lambda: np.zeros(0))
    limits: range = range(0)
    smoothing: tuple[float, ...] = (0.0,)
    stop_when_met: bool = True
    output_names: tuple[str, ...] = ()
    scenario: ScenarioEvaluator | None = None
    staged: Callable[[], StagedProblem] | None = None
    by_steps: StepwiseEvaluator | None = None
    asking: Callable[[Array], StagedProblem] | None = None
    measure: Measure | None = None
    guessed_states: GuessedStates | None = None
    confirms: Callable[[Array], bool] | None = None
    finer_errors: Callable[[Array], Array] | None = None
    multipliers: Mapping[str, Array] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Return the length of z."""
        return self.blocks[-1].stop if self.blocks else 0

    def stacked(self, name: str) -> Array:
        """Return ``guess``, ``lower``, ``upper``, ``scale`` or ``spread`` (n,) of all blocks in the order of z."""
        return np.concatenate([getattr(block, name) for block in self.blocks] or [np.zeros(0)])

    def start(self, seed: int) -> Array:
        """Return the guess (n,).

        Seeds above 0 perturb it by ``spread`` times standard normals, clipped into the bounds.
        """
        guess = self.stacked("guess")
        if seed > 0:
            noise = np.random.default_rng([seed, 0]).standard_normal(self.n)
            guess = guess + self.stacked("spread") * noise
        return np.clip(guess, self.stacked("lower"), self.stacked("upper"))

    def by_block(self, z: Array) -> dict[str, Array]:
        """Split ``z`` into arrays (components, knots) by name."""
        return {b.name: z[b.start : b.stop].reshape(b.shape, order="F") for b in self.blocks}

    def from_blocks(self, values: Mapping[str, Array]) -> Array:
        """Return the inverse of ``by_block`` (n,)."""
        return np.concatenate([np.asarray(values[b.name], float).ravel(order="F") for b in self.blocks])

    def met(self, errors: Array) -> bool:
        """Whether there is something to meet and all of it is met; NaN never is."""
        return errors.size > 0 and bool(np.all(errors <= 1))

    def violation(self, errors: Array) -> float:
        """Return the largest error of a constraint, 0 where all constraints are met."""
        largest = float(np.max(errors[self.limits], initial=0.0))
        return 0.0 if largest <= 1 else largest
