"""How candidates are rated: in the problem's own situation, or on the average of some that are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from symphys.shooting import Drawn, Situations
from symphys.solvers.core.driver import begin, converged
from symphys.solvers.core.evaluator import Meter, Verdict
from symphys.solvers.core.interface import Log
from symphys.solvers.core.outcome import Array, Status
from symphys.solvers.core.point import Point
from symphys.solvers.randomized.validation import SITUATIONS, Batch, Validation, told


class Trials(Protocol):
    """Rates candidates, and says which points are kept.

    Attributes:
        rollouts: for each candidate.
    """

    rollouts: int

    def start(self, z: Array) -> Point:
        """The point where a search begins."""
        ...

    def rate(self, Z: Sequence[Array], generation: int) -> list[Point]:
        """A generation."""
        ...

    def keep(self, z: Array, generation: int, due: bool = False) -> None:
        """See whether the mean of a search is to be kept; ``due``: in whatever generation."""
        ...

    def converged(self) -> Verdict:
        """What to say of a search that has come to its end."""
        ...

    def told(self, verdict: Verdict, start: Array) -> Verdict:
        """The verdict on a search from there, or what to say where its start (n,) is kept."""
        ...


class Alone:
    """In the problem's own situation, where what is best is kept."""

    rollouts = 1

    def __init__(self, meter: Meter) -> None:
        """Evaluate by it."""
        self.meter = meter

    def start(self, z: Array) -> Point:
        """See ``Trials``."""
        return begin(self.meter.value(z))

    def rate(self, Z: Sequence[Array], generation: int) -> list[Point]:
        """See ``Trials``."""
        return self.meter.values(Z)

    def keep(self, z: Array, generation: int, due: bool = False) -> None:
        """See ``Trials``."""

    def converged(self) -> Verdict:
        """See ``Trials``."""
        return converged(self.meter)

    def told(self, verdict: Verdict, start: Array) -> Verdict:
        """See ``Trials``."""
        return verdict


class Drawing:
    """In situations that each generation draws anew, the same for all of it; means of the search are validated."""

    def __init__(
        self,
        meter: Meter,
        situations: Situations,
        samples: int,
        width: float,
        batch: Batch,
        every: int,
        log: Log | None,
    ) -> None:
        """``samples`` situations for each candidate; a validation after ``every`` generations."""
        self.meter, self.situations, self.rollouts, self.width = meter, situations, samples, width
        self.seed, self.every = batch.seed, every
        self.validation = Validation(meter, situations, batch, log)

    def start(self, z: Array) -> Point:
        """See ``Trials``."""
        return begin(self.rate([z], 0)[0])

    def rate(self, Z: Sequence[Array], generation: int) -> list[Point]:
        """See ``Trials``: means; a candidate with one motion that is not finite is none."""
        meter, each = self.meter, self.rollouts
        stream = np.random.default_rng([self.seed, SITUATIONS, generation])
        drawn = self.situations.draw(stream, each, self.width, generation % len(self.situations.grids))
        many = Drawn(drawn.grid, np.tile(drawn.numbers, (len(Z), 1)))
        values = self.situations.value(np.repeat(np.array(Z), each, axis=0), many, meter.smoothing)
        meter.counts.rollouts += len(many.numbers)
        spoilt = self.validation.batch.count
        merits, objectives = (part.reshape(-1, each).mean(axis=1) for part in (values.merit, values.objective))
        return [
            Point(z, merit, objective, errors.copy(), meter.problem.met(errors), told(values, k * each), spoilt=spoilt)
            for k, (z, merit, objective, errors) in enumerate(
                zip(Z, merits.tolist(), objectives.tolist(), values.errors[::each], strict=True)
            )
        ]

    def keep(self, z: Array, generation: int, due: bool = False) -> None:
        """See ``Trials``."""
        if due or generation % self.every == 0:
            self.validation.keep(self.meter.clip(z))

    def converged(self) -> Verdict:
        """See ``Trials``."""
        return Verdict(Status.CONVERGED)

    def told(self, verdict: Verdict, start: Array) -> Verdict:
        """See ``Trials``."""
        return self.validation.told(verdict, start)
