"""Descents over samples of a scenario, redrawn in each iteration: batches, Adam, a falling rate, validation.

Draws of an iteration depend on the seed and its number alone. The gradient estimate is the method's own.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Generic, TypeVar

import numpy as np

from symphys.records import dataclass
from symphys.shooting import ScenarioSamples, ShootingProblem
from symphys.solvers.core.checkpoint import revive
from symphys.solvers.core.directions import DirectionMemory, MomentumWeights, adam
from symphys.solvers.core.interface import Iteration, Method, StageContext
from symphys.solvers.core.options import SolverOptions, at_least, require
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point
from symphys.solvers.randomized.validation import SAMPLE_STREAM, Validation, ValidationBatch
from symphys.types import Array

NO_SCENARIO = (
    "this problem has no samples to draw: add [[scenario]] tables (and a C compiler, if there is none), or use "
    "another solver"
)
ITERATIONS_DONE = "all iterations are done; kept is the point that did best in the validation samples"
SURVIVING_SHARE = "share of the batch that lasts"


@dataclass(frozen=True)
class DescentOptions(SolverOptions):
    """Options that all descents over samples share.

    Attributes:
        iterations: number of batches in each smoothing stage.
        samples: samples in each batch, including the nominal one.
        width: spread of the samples, relative to the [[scenario]] tables.
        rate: learning rate of Adam, in units of scale.
        hold: share of the iterations at the full rate, which then falls linearly.
        last: share of the rate at the end.
        betas: decay rates of Adam's two moments.
        validation: samples that select the best point; 0: keep the last.
        validation_width: spread of the validation samples.
        every: iterations between validations.
        patience: share of the iterations before the first validation.
    """

    iterations: int = 200
    samples: int = 32
    width: float = 1.5
    rate: float = 0.01
    hold: float = 0.5
    last: float = 0.05
    betas: tuple[float, float] = (0.9, 0.99)
    validation: int = 64
    validation_width: float = 1.3
    every: int = 5
    patience: float = 0.3

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        at_least(0, iterations=self.iterations, validation=self.validation)
        at_least(1, samples=self.samples, every=self.every)
        at_least(0, width=self.width, validation_width=self.validation_width)
        require(self.rate > 0, "rate", "above 0")
        for name, share in {"hold": self.hold, "last": self.last, "patience": self.patience}.items():
            require(0 <= share <= 1, name, "in [0, 1]")
        require(all(0 <= share < 1 for share in self.betas), "betas", "in [0, 1)")

    def rate_at(self, iteration: int) -> float:
        """Return the rate of an iteration."""
        left = (self.iterations - iteration) / max((1 - self.hold) * self.iterations, 1)
        return self.rate * min(1.0, max(self.last, left))

    def batch(self, seed: int) -> ValidationBatch:
        """Return the validation batch."""
        return ValidationBatch(self.validation, self.validation_width, seed)

    def validates(self, iteration: int) -> bool:
        """Whether the point of this iteration is validated; the last one always is."""
        if not self.validation:
            return iteration == self.iterations
        due = iteration >= self.patience * self.iterations and iteration % self.every == 0
        return due or iteration == self.iterations


@dataclass(frozen=True)
class DescentState:
    """The state between two iterations.

    Attributes:
        iteration: batches that were drawn.
        z: (n,) the point.
        memory: Adam's.
    """

    iteration: int
    z: Array
    memory: DirectionMemory


@dataclass(frozen=True)
class GradientEstimate:
    """The gradient estimate of a batch of samples at a point.

    Attributes:
        point: with means over the batch, and the errors of the problem's own sample.
        gradient: (n,) scaled; its length is of no matter.
        typical: of the gradients' norms; nan without any.
        words: for the log.
        outputs: for the trace.
    """

    point: Point
    gradient: Array
    typical: float
    words: str
    outputs: Mapping[str, float]


OptionsT = TypeVar("OptionsT", bound=DescentOptions)


class Descent(Method[DescentState], Generic[OptionsT]):
    """The method except for its gradient estimate, see ``interface.Method``.

    Attributes:
        scale: (n,) of the problem; 0 for what is held by equal bounds, so that it is no part of any gradient.
    """

    def __init__(self, context: StageContext, options: OptionsT) -> None:
        """Draw the validation samples."""
        self.evaluator, self.start, self.seed, self.log = context.evaluator, context.start, context.seed, context.log
        self.options, self.scenario = options, context.evaluator.scenario
        self.scale = np.where(self.evaluator.lower < self.evaluator.upper, self.evaluator.scale, 0.0)
        self.validation = Validation(self.evaluator, options.batch(self.seed), self.log)

    @abstractmethod
    def estimate(self, state: DescentState, samples: ScenarioSamples) -> GradientEstimate | StopReason:
        """Estimate the gradient from a batch; return the reason where that fails."""

    def init(self) -> Iteration[DescentState]:
        """Validate the start as the first point."""
        if self.options.validation:
            self.validation.keep(self.start)
        return Iteration(DescentState(0, self.start, DirectionMemory.empty(self.start.size)), None)

    def step(self, state: DescentState) -> Iteration[DescentState] | StopReason:
        """Draw one batch, make one step of Adam, perhaps validate."""
        options, k = self.options, state.iteration
        samples = self.draw(k)
        found = self.estimate(state, samples)
        if isinstance(found, StopReason):
            return found
        grid = self.scenario.grids[samples.grid]
        self.log(f"{k}{f' {grid}' if grid else ''}: objective {found.point.objective:.5g}, {found.words}")
        direction, memory = adam(found.gradient, state.memory, options.rate_at(k), MomentumWeights(0.0, options.betas))
        z = self.evaluator.clip(state.z + self.scale * direction)
        if options.validates(k + 1):
            self.validation.keep(z)
        length = float(np.linalg.norm(z - state.z))
        names = self.evaluator.problem.output_names
        outputs = {**dict(zip(names, found.point.outputs.tolist(), strict=False)), **found.outputs}
        return Iteration(DescentState(k + 1, z, memory), found.point, found.typical, length, outputs)

    def terminate(self, state: DescentState) -> StopReason | None:
        """Return the reason after the last iteration."""
        if state.iteration < self.options.iterations:
            return None
        return self.conclude(state, StopReason(Status.BUDGET, ITERATIONS_DONE))

    def conclude(self, state: DescentState, reason: StopReason) -> StopReason:
        """Implement ``Method.conclude``: the last point may be kept, so it is validated, unless it was."""
        if state.iteration and not self.options.validates(state.iteration):
            self.validation.keep(state.z)
        return self.validation.conclude(reason, self.start)

    def resume(self, saved: dict[str, Any]) -> DescentState:
        """Implement ``Method.resume``."""
        return revive(DescentState, saved, DirectionMemory)

    def draw(self, iteration: int) -> ScenarioSamples:
        """Draw the batch of an iteration, on the grid of that iteration."""
        stream = np.random.default_rng([self.seed, SAMPLE_STREAM, iteration])
        grid = iteration % len(self.scenario.grids)
        return self.scenario.draw(stream, self.options.samples, self.options.width, grid)


def refusal(problem: ShootingProblem) -> str:
    """Return why a descent over samples is not for a problem; empty if it is."""
    return NO_SCENARIO if problem.scenario is None else ""
