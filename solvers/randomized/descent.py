"""Descents in situations that are drawn anew: batches, steps of Adam, a falling rate, validation, going on.

Draws of an iteration depend on the seed and its number alone. What points a way, and from what, is the solver's own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from symphys.shooting import Drawn, Situations
from symphys.solvers.core.checkpoint import revive
from symphys.solvers.core.continuation import Stage
from symphys.solvers.core.evaluator import Meter, Verdict
from symphys.solvers.core.interface import Log
from symphys.solvers.core.options import at_least, require
from symphys.solvers.core.outcome import Array, Status
from symphys.solvers.core.point import Point
from symphys.solvers.methods.directions import Habits, Memory, adam
from symphys.solvers.randomized.validation import SITUATIONS, Batch, Validation

NO_SITUATIONS = (
    "this problem has no situations to draw: add [[scenario]] tables (and a C compiler, if there is none), or use "
    "another solver"
)
DONE = "all iterations are done; kept is the point that did best in the situations for validation"


@dataclass(frozen=True)
class DescentOptions:
    """Options that all descents in drawn situations share.

    Attributes:
        iterations: batches, in each stage of smoothing.
        samples: situations in a batch, the problem's own among them. Discretisations take turns.
        width: how widely situations vary, relative to their tables.
        rate: of Adam, in units of scale.
        hold: share of the iterations at the full rate; from then on it falls in proportion, to ``last`` of it.
        last: share of the rate at the end.
        betas: of Adam.
        validation: situations that decide which point is kept, the start among them; 0: the last point is.
        validation_width: how widely these vary.
        every: iterations between two validations.
        patience: share of the iterations before the first of them.
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
        """ValueError that names the option and says what would be valid."""
        at_least(0, iterations=self.iterations, validation=self.validation)
        at_least(1, samples=self.samples, every=self.every)
        at_least(0, width=self.width, validation_width=self.validation_width)
        require(self.rate > 0, "rate", "above 0")
        for name, share in {"hold": self.hold, "last": self.last, "patience": self.patience}.items():
            require(0 <= share <= 1, name, "in [0, 1]")
        require(all(0 <= share < 1 for share in self.betas), "betas", "in [0, 1)")

    def rate_at(self, iteration: int) -> float:
        """The rate in force."""
        left = (self.iterations - iteration) / max((1 - self.hold) * self.iterations, 1)
        return self.rate * min(1.0, max(self.last, left))

    def batch(self, seed: int) -> Batch:
        """For validation."""
        return Batch(self.validation, self.validation_width, seed)

    def validates(self, iteration: int) -> bool:
        """Whether the point of this iteration is validated; the last one always is."""
        if not self.validation:
            return iteration == self.iterations
        due = iteration >= self.patience * self.iterations and iteration % self.every == 0
        return due or iteration == self.iterations


@dataclass(frozen=True)
class State:
    """Between two iterations.

    Attributes:
        iteration: batches that were drawn.
        z: (n,) the point.
        memory: Adam's.
    """

    iteration: int
    z: Array
    memory: Memory


@dataclass(frozen=True)
class Found:
    """What a batch says of a point.

    Attributes:
        point: with means over the batch, and the errors of the problem's own situation.
        gradient: (n,) scaled; its length is of no matter.
        typical: of the gradients' norms; nan without any.
        words: for the log.
        told: for the trace.
    """

    point: Point
    gradient: Array
    typical: float
    words: str
    told: Mapping[str, float]


OptionsT = TypeVar("OptionsT", bound=DescentOptions)


LASTING = "share of the batch that lasts"


class Descent(ABC, Generic[OptionsT]):
    """The iterations of one stage.

    Attributes:
        scale: (n,) of the problem; 0 for what is held by equal bounds, so that it is no part of any gradient.
    """

    def __init__(self, meter: Meter, situations: Situations, options: OptionsT, seed: int, log: Log | None) -> None:
        """Draw the situations for validation."""
        self.meter, self.situations, self.options, self.seed, self.log = meter, situations, options, seed, log
        self.scale = np.where(meter.lower < meter.upper, meter.scale, 0.0)
        self.validation = Validation(meter, situations, options.batch(seed), log)

    @abstractmethod
    def way(self, state: State, drawn: Drawn) -> Found:
        """What a batch says; Stop where that is nothing."""

    def run(self, z: Array, saved: dict[str, object] | None) -> Verdict:
        """All of them, or those that are left; the start is the first point that is validated."""
        options = self.options
        if options.validation and not saved:
            self.validation.keep(z)
        state = revive(State, saved, Memory) if saved else State(0, z, Memory.empty(z.size))
        while state.iteration < options.iterations:
            state = self.advance(state)
        return self.validation.told(Verdict(Status.BUDGET, DONE), z)

    def advance(self, state: State) -> State:
        """One batch, one step, perhaps a validation."""
        options, k = self.options, state.iteration
        drawn = self.draw(k)
        found = self.way(state, drawn)
        if self.log:
            grid = self.situations.grids[drawn.grid]
            self.log(f"{k}{f' {grid}' if grid else ''}: objective {found.point.objective:.5g}, {found.words}")
        direction, memory = adam(found.gradient, state.memory, options.rate_at(k), Habits(0.0, options.betas))
        z = self.meter.clip(state.z + self.scale * direction)
        if options.validates(k + 1):
            self.validation.keep(z)
        following = State(k + 1, z, memory)
        self.meter.commit(found.point, following, found.typical, float(np.linalg.norm(z - state.z)), found.told)
        return following

    def draw(self, iteration: int) -> Drawn:
        """The batch of an iteration, on the grid whose turn it is."""
        stream = np.random.default_rng([self.seed, SITUATIONS, iteration])
        grid = iteration % len(self.situations.grids)
        return self.situations.draw(stream, self.options.samples, self.options.width, grid)


def stage_of(kind: type[Descent[OptionsT]], options: OptionsT, seed: int, log: Log | None) -> Stage:
    """A stage that descends so, where situations differ."""

    def stage(meter: Meter, z: Array, saved: dict[str, object] | None) -> Verdict:
        if meter.problem.situations is None:
            return Verdict(Status.NOT_APPLICABLE, NO_SITUATIONS)
        return kind(meter, meter.problem.situations, options, seed, log).run(z, saved)

    return stage
