"""Samples of scenarios: the numbers that differ between samples, or between problems of a sweep, one row each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symphys.problem import Problem
from symphys.transcription.randomization.numbers import QuantitySampler, swept_inputs
from symphys.transcription.randomization.poses import PoseSampler
from symphys.types import Array


class Sampler:
    """Samples of a problem's scenarios, on one grid of time.

    Attributes:
        problem: with a variable for all that differs, behind its own.
        nominal: (s,) the numbers of the file.
    """

    def __init__(self, problem: Problem) -> None:
        """See what differs."""
        scenarios = problem.scenarios
        assert scenarios is not None, "nothing differs"
        self._parts: list[QuantitySampler | PoseSampler] = [
            QuantitySampler(problem, varied) for varied in scenarios.quantities
        ]
        self._parts += [PoseSampler(problem, posed) for posed in scenarios.poses]
        own = (*swept_inputs(problem), *(variable for part in self._parts for variable in part.variables))
        self.problem = replace(problem, variables=(*problem.variables, *own), scenarios=None)
        self.nominal = np.concatenate([np.zeros(0), *(variable.guess for variable in own)])

    def draw(self, rng: np.random.Generator, count: int, width: float) -> Array:
        """(count, s): the first as the file has it, the others drawn ``width`` times as wide as there."""
        drawn = np.concatenate([np.zeros((count, 0)), *(part.draw(rng, count, width) for part in self._parts)], axis=1)
        swept = self.nominal[: self.nominal.size - drawn.shape[1]]
        rows = np.concatenate([np.tile(swept, (count, 1)), drawn], axis=1)
        rows[:1] = self.nominal
        return rows
