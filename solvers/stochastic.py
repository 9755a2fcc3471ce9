"""First-order descent in situations that are drawn anew in each iteration: what long motions through contact need.

Each iteration evaluates gradients in a batch of situations, the problem's own first, then takes a step of Adam along
the mean of the gradients, each shortened by itself before (``clip``): a few situations in which small changes explode
would drown all others. ``forget`` lets adjoints fade on their way back, at the price of a bias. A batch of its own,
drawn once, decides which point is kept, since the path crosses regions that look good in a few situations only.

Motions that are over before their time add nothing to a gradient after that, so ``fallen`` lets what they say of the
time before count more; that they were over is seen by the validation batch, through the cost of [fall].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from symphys.shooting import Drawn, ShootingProblem, Situations
from symphys.solvers.averages import Average, average, evolution, mean, together
from symphys.solvers.checkpoint import revive
from symphys.solvers.directions import Habits, Memory, adam
from symphys.solvers.interface import Log, Solver
from symphys.solvers.meter import Meter, Point, Stop, Verdict
from symphys.solvers.options import at_least, require
from symphys.solvers.outcome import Array, Monitor, Outcome, Status
from symphys.solvers.session import run
from symphys.solvers.staged import Request

NO_SITUATIONS = (
    "this problem has no situations to draw: add [[scenario]] tables (and a C compiler, if there is none), or use "
    "another solver"
)
DONE = "all iterations are done; kept is the point that did best in the situations for validation"
NOT_FINITE = "not one situation of a batch is finite: bound the variables, lower `rate`, or add [fall]"
VALIDATION, SITUATIONS, NOISE = 1, 2, 3
"""Streams of random numbers."""


@dataclass(frozen=True)
class StochasticOptions:
    """Options of descent in drawn situations.

    Attributes:
        iterations: batches, in each stage of smoothing.
        samples: situations in a batch, the problem's own among them. Discretisations take turns.
        width: how widely situations vary, relative to their tables.
        rate: of Adam, in units of scale.
        hold: share of the iterations at the full rate; from then on it falls in proportion, to ``last`` of it.
        last: share of the rate at the end.
        betas: of Adam.
        clip: largest norm of each situation's scaled gradient; inf: none.
        forget: [1/s] how fast adjoints fade on their way back; 0: not at all.
        fallen: weight of a motion that was over before its time.
        evolution: share of the direction that comes from values alone; 1 is an evolution strategy without gradients.
        sigma: its spread, in units of scale.
        validation: situations that decide which point is kept; 0: the last point is.
        validation_width: how widely these vary.
        every: iterations between two validations.
        patience: share of the iterations before the first of them.
    """

    __pydantic_config__: ClassVar[dict[str, object]] = {"extra": "forbid"}

    iterations: int = 200
    samples: int = 32
    width: float = 1.5
    rate: float = 0.01
    hold: float = 0.5
    last: float = 0.05
    betas: tuple[float, float] = (0.9, 0.99)
    clip: float = 1.0
    forget: float = 2.0
    fallen: float = 5.0
    evolution: float = 0.0
    sigma: float = 0.03
    validation: int = 64
    validation_width: float = 1.3
    every: int = 5
    patience: float = 0.3

    def __post_init__(self) -> None:
        """ValueError that names the option and says what would be valid."""
        at_least(0, iterations=self.iterations, validation=self.validation)
        at_least(1, samples=self.samples, every=self.every)
        at_least(0, width=self.width, validation_width=self.validation_width, forget=self.forget)
        require(self.rate > 0, "rate", "above 0")
        require(self.clip > 0, "clip", "above 0")
        require(self.fallen > 0, "fallen", "above 0")
        require(0 < self.sigma < math.inf, "sigma", "above 0")
        shares = {"hold": self.hold, "last": self.last, "evolution": self.evolution, "patience": self.patience}
        for name, share in shares.items():
            require(0 <= share <= 1, name, "in [0, 1]")
        require(all(0 <= share < 1 for share in self.betas), "betas", "in [0, 1)")

    def rate_at(self, iteration: int) -> float:
        """The rate in force."""
        left = (self.iterations - iteration) / max((1 - self.hold) * self.iterations, 1)
        return self.rate * min(1.0, max(self.last, left))

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
        spoilt: situations for validation in which the point that is kept is not finite.
    """

    iteration: int
    z: Array
    memory: Memory
    spoilt: int


def solve(
    problem: ShootingProblem,
    start: Array,
    options: StochasticOptions,
    seed: int = 0,
    monitor: Monitor | None = None,
    checkpoint: dict[str, object] | None = None,
    log: Log | None = None,
) -> Outcome:
    """Descend. Draws of an iteration depend on the seed and its number alone. See ``interface.Solve``."""

    def stage(meter: Meter, z: Array, saved: dict[str, object] | None) -> Verdict:
        if problem.situations is None:
            return Verdict(Status.NOT_APPLICABLE, NO_SITUATIONS)
        descent = Descent(meter, problem.situations, options, seed, log)
        state = revive(State, saved, Memory) if saved else State(0, z, Memory.empty(z.size), options.validation)
        while state.iteration < options.iterations:
            state = descent.advance(state)
        return Verdict(Status.BUDGET, DONE)

    return run(Request("stochastic", problem, start, monitor, checkpoint, log), stage)


class Descent:
    """The iterations of one stage."""

    def __init__(
        self, meter: Meter, situations: Situations, options: StochasticOptions, seed: int, log: Log | None
    ) -> None:
        """Draw the situations for validation."""
        self.meter, self.situations, self.options, self.seed, self.log = meter, situations, options, seed, log
        stream = np.random.default_rng([seed, VALIDATION])
        self.validation = situations.draw(stream, max(options.validation, 1), options.validation_width)

    def advance(self, state: State) -> State:
        """One batch, one step, perhaps a validation."""
        options, k = self.options, state.iteration
        drawn = self.draw(k)
        found = self.gradient(state, drawn)
        direction, memory = adam(
            self.mixed(state, drawn, found), state.memory, options.rate_at(k), Habits(0.0, options.betas)
        )
        z = self.meter.clip(state.z + self.meter.scale * direction)
        point = Point(state.z, found.merit, found.objective, found.errors, self.meter.problem.met(found.errors))
        spoilt = self.validate(z, state.spoilt) if options.validates(k + 1) else state.spoilt
        following = State(k + 1, z, memory, spoilt)
        self.meter.commit(point, following, found.typical, float(np.linalg.norm(z - state.z)))
        return following

    def draw(self, iteration: int) -> Drawn:
        """The batch of an iteration, on the grid whose turn it is."""
        stream = np.random.default_rng([self.seed, SITUATIONS, iteration])
        grid = iteration % len(self.situations.grids)
        return self.situations.draw(stream, self.options.samples, self.options.width, grid)

    def gradient(self, state: State, drawn: Drawn) -> Average:
        """The batch's average at the point; Stop where there is none."""
        options, meter = self.options, self.meter
        values = self.situations.gradient(state.z[None], drawn, meter.smoothing, options.forget)
        meter.counts.gradients += options.samples
        found = average(values, meter.scale, options.clip, options.fallen)
        if found.left_out == options.samples:
            raise Stop(Status.NOT_FINITE, NOT_FINITE)
        if self.log:
            grid = self.situations.grids[drawn.grid]
            self.log(
                f"{state.iteration}{f' {grid}' if grid else ''}: objective {found.objective:.5g}, {found.alive:.0%} "
                f"last, gradients {found.typical:.2g} (at most {found.longest:.2g}), agreement {found.agreement:.2f}"
                + f", {found.left_out} not finite"
                * (found.left_out > 0)
            )
        return found

    def mixed(self, state: State, drawn: Drawn, found: Average) -> Array:
        """The gradient that the step is made of."""
        options, meter = self.options, self.meter
        if not options.evolution:
            return found.gradient
        stream = np.random.default_rng([self.seed, NOISE, state.iteration])
        step = options.sigma * meter.scale
        evolved = evolution(self.situations, state.z, step, drawn, meter.smoothing, stream)
        meter.counts.rollouts += 2 * options.samples
        return together(found.gradient, evolved, options.evolution)

    def validate(self, z: Array, spoilt: int) -> int:
        """Keep the point if it does best in the situations for validation; Stop(MET) where that is enough.

        Fewer situations that are not finite go before a lower merit. Returns their number at the point that is kept.
        """
        meter, count = self.meter, len(self.validation.numbers)
        values = self.situations.value(z[None], self.validation, meter.smoothing)
        meter.counts.rollouts += count
        known, errors = np.isfinite(values.merit), values.errors[0].copy()
        merit, bad = mean(values.merit[known]), int((~known).sum())
        point = Point(z, merit, mean(values.objective[known]), errors, meter.problem.met(errors))
        best = meter.best is None or (bad, merit) < (spoilt, meter.best.merit)
        kept = not self.options.validation or (best and bad < count)
        if self.log:
            lasted = "" if values.alive is None else f", {values.alive.mean():.0%} last"
            spoils = f", {bad} not finite" * (bad > 0)
            self.log(f"  validation: {merit:.5g}{lasted}{spoils}{' (kept)' * kept}")
        if not kept:
            return spoilt
        meter.best = point
        if point.met and meter.problem.stop_when_met:
            raise Stop(Status.MET)
        return bad


STOCHASTIC = Solver(
    "stochastic", "first-order descent in situations that are drawn anew", StochasticOptions, solve, situations=True
)
"""See ``Solver``."""
