"""The counting evaluator between a method and its problem, at one smoothing and within the bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from symphys.records import dataclass
from symphys.shooting import Evaluator, ScenarioEvaluator, ScenarioSamples, ShootingProblem, StagedMotion, Values
from symphys.solvers.core.outcome import Counts
from symphys.solvers.core.point import Incumbent, Point
from symphys.types import Array


class WorkCounter:
    """The work of a solve so far, shared by the evaluators of all stages."""

    def __init__(self, counts: Counts | None = None) -> None:
        """Start from ``counts``, those of a resumed solve."""
        self._counts = counts or Counts()

    @property
    def counts(self) -> Counts:
        """The total work."""
        return self._counts

    def add(self, work: Counts) -> None:
        """Add work."""
        self._counts += work


@dataclass(frozen=True)
class CountingEvaluator:
    """Evaluates a problem at one smoothing and counts the work.

    ``value``, ``values``, ``gradient``, ``residuals`` and ``jacobian`` offer their points to the incumbent, which
    raises Stop once a point meets everything, where the problem asks to stop there. ``rate`` and the samples of a
    scenario are offered to none.

    Attributes:
        problem: the evaluated problem.
        smoothing: of all evaluations.
        incumbent: the best point of the stage.
        counter: of the work.
        constraints: whether violated constraints come before the merit, see ``Point.violation``.
    """

    problem: ShootingProblem
    smoothing: float
    incumbent: Incumbent
    counter: WorkCounter = field(default_factory=WorkCounter)
    constraints: bool = False

    @cached_property
    def scale(self) -> Array:
        """The typical change (n,) of z."""
        return self.problem.stacked("scale")

    @cached_property
    def lower(self) -> Array:
        """The lower bounds (n,) of z."""
        return self.problem.stacked("lower")

    @cached_property
    def upper(self) -> Array:
        """The upper bounds (n,) of z."""
        return self.problem.stacked("upper")

    def at(self, smoothing: float, incumbent: Incumbent) -> CountingEvaluator:
        """Return an evaluator of the same problem and counter at another smoothing."""
        return replace(self, smoothing=smoothing, incumbent=incumbent)

    def clip(self, z: Array) -> Array:
        """Return the nearest point within the bounds."""
        return np.clip(z, self.lower, self.upper)

    def stationarity(self, z: Array, gradient: Array) -> float:
        """Return the length of the projected gradient step in z / scale; 0 at a stationary point."""
        return float(np.linalg.norm((self.clip(z - gradient * self.scale**2) - z) / self.scale))

    def value(self, z: Array) -> Point:
        """Evaluate one rollout at z, which must lie within the bounds."""
        return self.values([z])[0]

    def along(self, motion: StagedMotion) -> Point:
        """Evaluate a z whose motion is known; simulate it where the problem is not evaluated by steps."""
        steps = self.problem.by_steps
        if steps is None:
            return self.value(motion.z)
        return self._offered(self._points(motion.z[None], steps.along(motion.z[None], motion.x[None])))[0]

    def values(self, population: Sequence[Array]) -> list[Point]:
        """Evaluate one rollout for each point in one call; stop after it if one of them meets everything."""
        return self._offered(self.rate(population))

    def rate(self, population: Sequence[Array]) -> list[Point]:
        """Evaluate one rollout for each point in one call, without offering them to the incumbent."""
        Z = np.array(population)
        values = self._evaluator.value(Z, self.smoothing)
        self.counter.add(Counts(rollouts=len(Z)))
        return self._points(Z, values)

    def gradient(self, z: Array) -> Point:
        """Evaluate one gradient at z."""
        values = self._evaluator.gradient(z[None], self.smoothing)
        self.counter.add(Counts(gradients=1))
        return self._offered(self._points(z[None], values))[0]

    def residuals(self, z: Array) -> Point:
        """Evaluate one rollout at z, with residuals."""
        values = self._evaluator.residuals(z[None], self.smoothing)
        self.counter.add(Counts(rollouts=1))
        return self._offered(self._points(z[None], values))[0]

    def jacobian(self, z: Array) -> Point:
        """Evaluate one Jacobian of the residuals at z, from which the gradient follows."""
        values = self._evaluator.jacobian(z[None], self.smoothing)
        self.counter.add(Counts(jacobians=1))
        return self._offered(self._points(z[None], values))[0]

    def sample_values(self, Z: Array, samples: ScenarioSamples) -> Values:
        """Evaluate one rollout in each sample of a scenario; Z (batch, n), or (1, n) for all."""
        values = self.scenario.value(Z, samples, self.smoothing)
        self.counter.add(Counts(rollouts=len(samples.numbers)))
        return values

    def sample_gradients(
        self, z: Array, samples: ScenarioSamples, adjoint_discount: float = 0.0, horizon: float = math.inf
    ) -> Values:
        """Evaluate one gradient at z (n,) in each sample of a scenario; see ``ScenarioEvaluator.gradient``."""
        values = self.scenario.gradient(z[None], samples, self.smoothing, adjoint_discount, horizon)
        self.counter.add(Counts(gradients=len(samples.numbers)))
        return values

    @property
    def scenario(self) -> ScenarioEvaluator:
        """The problem's scenario; callers check first that it has one."""
        assert self.problem.scenario is not None, "the problem has a scenario"
        return self.problem.scenario

    @property
    def _evaluator(self) -> Evaluator:
        return self.problem.evaluator

    def _offered(self, points: list[Point]) -> list[Point]:
        self.incumbent.offer(points)
        return points

    def _points(self, Z: Array, values: Values) -> list[Point]:
        """Return the rows as points with their own copies of all arrays."""
        names = [name for name in ("outputs", "gradient", "residuals", "jacobian") if getattr(values, name) is not None]
        measure = self.problem.measure
        merits = (values.merit if measure is None else measure(values.objective, values.errors)).tolist()
        objectives = values.objective.tolist()
        points = []
        for row, (merit, objective) in enumerate(zip(merits, objectives, strict=True)):
            parts = {name: getattr(values, name)[row].copy() for name in names}
            if "jacobian" in parts:
                parts["gradient"] = 2 * parts["jacobian"].T @ parts["residuals"]
            errors = values.errors[row].copy()
            z, met, violation = Z[row].copy(), self.problem.met(errors), self.violation(errors)
            points.append(Point(z, merit, objective, errors, met, **parts, violation=violation))
        return points

    def violation(self, errors: Array) -> float:
        """Implement ``Point.violation``."""
        return self.problem.violation(errors) if self.constraints else 0.0
