"""The meter between a solver and its problem: evaluates, counts, remembers the best point, writes the trace."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, astuple, dataclass, replace
from types import MappingProxyType

import numpy as np

from symphys.shooting import ShootingProblem, Values
from symphys.solvers.core.outcome import Array, Counts, Monitor, StageResult, Status, TraceRow
from symphys.solvers.core.point import Point

NOTHING: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True)
class Verdict:
    """How a stage of a solve ended; see ``Outcome``."""

    status: Status
    advice: str = ""


class Stop(Exception):
    """Ends a stage from within an evaluation."""

    def __init__(self, status: Status, advice: str = "") -> None:
        """Carry the verdict."""
        super().__init__(status.value)
        self.verdict = Verdict(status, advice)


@dataclass(frozen=True)
class Snapshot:
    """All that a solve needs to go on: taken when an iteration is complete, never in its middle.

    Attributes:
        stages: of smoothing, that were over by then.
        state: the solver's own.
        best: of this stage.
        last: (n,) z of the last row of the trace.
        counts, rows, seconds: the work up to here, and how many rows of the trace tell of it.
    """

    stages: tuple[StageResult, ...]
    state: object
    best: Point
    last: Array
    counts: Counts
    rows: int
    seconds: float


class Meter:
    """Evaluates a problem at points inside its bounds.

    ``value``, ``gradient``, ``residuals`` and ``jacobian`` raise Stop(MET) once a point meets everything, where the
    problem asks to stop there; the point is ``best`` then. ``solution`` (n,) is set where that is not the last best.
    """

    def __init__(self, problem: ShootingProblem, monitor: Monitor | None = None, constraints: bool = False) -> None:
        """Nothing is evaluated yet; ``constraints``: violated ones come before the merit."""
        self.problem = problem
        self.monitor = monitor
        self.constraints = constraints
        self.scale, self.lower, self.upper = (problem.stacked(field) for field in ("scale", "lower", "upper"))
        self.counts = Counts()
        self.rows: list[TraceRow] = []
        self.best: Point | None = None
        self.last: Array | None = None
        self.stages: tuple[StageResult, ...] = ()
        self.smoothing = problem.smoothing[0]
        self.snapshot: Snapshot | None = None
        self.solution: Array | None = None
        self.began, self.earlier = time.perf_counter(), 0.0

    def enter(self, smoothing: float, resumed: bool = False) -> None:
        """Begin a stage, or go on with one; merits at another smoothing are not compared with those of this one."""
        self.smoothing = smoothing
        if not resumed:
            self.best, self.last = None, None

    def restore(self, snapshot: Snapshot, rows: Iterable[TraceRow]) -> None:
        """Go on from a snapshot and its trace, as if there had been no break."""
        best = replace(snapshot.best, violation=self.violation(snapshot.best.errors))
        self.snapshot, self.best, self.last = snapshot, best, snapshot.last
        self.stages = snapshot.stages
        self.counts, self.rows = replace(snapshot.counts), list(rows)
        self.earlier, self.began = snapshot.seconds, time.perf_counter()

    @property
    def seconds(self) -> float:
        """Since the solve began, breaks left out."""
        return self.earlier + time.perf_counter() - self.began

    def clip(self, z: Array) -> Array:
        """The nearest point within the bounds."""
        return np.clip(z, self.lower, self.upper)

    def stationarity(self, z: Array, gradient: Array) -> float:
        """Length of the step in z / scale that the projected gradient takes; 0 at a stationary point."""
        return float(np.linalg.norm((self.clip(z - gradient * self.scale**2) - z) / self.scale))

    def value(self, z: Array) -> Point:
        """One rollout at z, which must lie within the bounds."""
        return self.values([z])[0]

    def values(self, population: Iterable[Array]) -> list[Point]:
        """One rollout for each, in one call; stops after it if one of them meets everything."""
        return self.seen(self.rated(population))

    def rated(self, population: Iterable[Array]) -> list[Point]:
        """One rollout for each, in one call, of which nothing is remembered."""
        Z = np.array(list(population))
        values = self.problem.evaluator.value(Z, self.smoothing)
        self.counts.rollouts += len(Z)
        return self.points(Z, values)

    def gradient(self, z: Array) -> Point:
        """One gradient at z."""
        values = self.problem.evaluator.gradient(z[None], self.smoothing)
        self.counts.gradients += 1
        return self.seen(self.points(z[None], values))[0]

    def residuals(self, z: Array) -> Point:
        """One rollout at z, with residuals."""
        values = self.problem.evaluator.residuals(z[None], self.smoothing)
        self.counts.rollouts += 1
        return self.seen(self.points(z[None], values))[0]

    def jacobian(self, z: Array) -> Point:
        """One Jacobian of the residuals at z; the gradient comes with it."""
        values = self.problem.evaluator.jacobian(z[None], self.smoothing)
        self.counts.jacobians += 1
        return self.seen(self.points(z[None], values))[0]

    def commit(
        self,
        point: Point,
        state: object,
        gradient_norm: float = math.nan,
        step: float = math.nan,
        told: Mapping[str, float] = NOTHING,
    ) -> None:
        """End an iteration: a row of the trace, a snapshot, then the monitor, which may raise KeyboardInterrupt."""
        best, self.last = self.best or point, point.z
        told = {**dict(zip(self.problem.output_names, best.outputs.tolist(), strict=False)), **told}
        work = (*astuple(self.counts), self.seconds)
        numbers = (point.objective, best.objective, point.miss, gradient_norm, step, self.smoothing)
        row = TraceRow(*(len(self.rows), *work, *numbers, told))
        self.rows.append(row)
        self.snapshot = Snapshot(self.stages, state, best, point.z, replace(self.counts), len(self.rows), row.seconds)
        if self.monitor:
            self.monitor(row)

    def settle(self, first: int, work: Counts) -> None:
        """For a library that tells its counts at the end only: add ``work`` to the rows from ``first`` on, evenly."""
        share = len(self.rows) - first
        for index in range(first, len(self.rows)):
            part = scaled(work, (index - first + 1) / share)
            self.rows[index] = replace(self.rows[index], **asdict(added(self.rows[index], part)))
        self.counts = added(self.counts, work)
        if self.snapshot:
            last = self.rows[self.snapshot.rows - 1]
            self.snapshot = replace(self.snapshot, counts=added(last, Counts()))

    def points(self, Z: Array, values: Values) -> list[Point]:
        """The rows as points with their own copies of everything."""
        names = [name for name in ("outputs", "gradient", "residuals", "jacobian") if getattr(values, name) is not None]
        merits, objectives = values.merit.tolist(), values.objective.tolist()
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
        """See ``Point``."""
        return self.problem.violation(errors) if self.constraints else 0.0

    def seen(self, points: list[Point]) -> list[Point]:
        """Remember the best; Stop(MET) if it meets everything and the problem asks to stop there."""
        for point in points:
            if point.better(self.best):
                self.best = point
        if self.best and self.best.met and self.problem.stop_when_met:
            raise Stop(Status.MET)
        return points


def scaled(counts: Counts, share: float) -> Counts:
    """A share of the work, in whole evaluations."""
    return Counts(*(round(number * share) for number in astuple(counts)))


def added(row: TraceRow | Counts, work: Counts) -> Counts:
    """The counts of a row and some more."""
    return Counts(**{name: getattr(row, name) + number for name, number in asdict(work).items()})
