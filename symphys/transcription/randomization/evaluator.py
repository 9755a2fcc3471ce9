"""Evaluates points in samples of scenarios: the numbers that differ from sample to sample stand behind z."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import exp, inf
from typing import Protocol

import numpy as np

from symphys.codegen import Kernel
from symphys.codegen.backends.simd import common, probed
from symphys.codegen.runtime.kernel import Outputs
from symphys.shooting import ScenarioSamples, Values, WithoutResiduals
from symphys.transcription.randomization.sampler import Sampler
from symphys.types import Array


class SampleEvaluator(Protocol):
    """Evaluates rows (B, n + s), each a point with the numbers of a sample behind it."""

    def sample_values(self, rows: Array, smoothing: float) -> Values:
        """Return what was found, without gradients."""
        ...

    def sample_gradients(self, rows: Array, smoothing: float, discount: float, skipped: int) -> Values:
        """Return what was found, with gradients (B, n + s).

        Args:
            rows: see above.
            smoothing: [m/s].
            discount: share of its adjoint that the state loses in each step back, see ``AdjointDiscount``.
            skipped: steps at the end that are not computed.
        """
        ...


class KernelSamples:
    """Evaluates samples by a kernel; see ``SampleEvaluator``."""

    def __init__(self, kernel: Kernel) -> None:
        """Of the sampler's problem, the merit seeded."""
        self.kernel = kernel

    def sample_values(self, rows: Array, smoothing: float) -> Values:
        """See ``SampleEvaluator``."""
        outputs = self.kernel.forward(rows, [smoothing])
        return replace(values(outputs), probe=probed(self.kernel, outputs))

    def sample_gradients(self, rows: Array, smoothing: float, discount: float, skipped: int) -> Values:
        """See ``SampleEvaluator``."""
        outputs, slopes = self.kernel.gradient(rows, [1.0], [smoothing], discount, skipped)
        return values(outputs, slopes)


class SampledEvaluator:
    """See ``ScenarioEvaluator``: a sampler, and what evaluates its samples, for each grid."""

    def __init__(
        self, grids: Sequence[str], samplers: Sequence[Sampler], evaluators: Sequence[SampleEvaluator]
    ) -> None:
        """For grids by name."""
        self.grids, self.samplers, self.evaluators = tuple(grids), tuple(samplers), tuple(evaluators)

    def draw(self, rng: np.random.Generator, count: int, width: float = 1.0, grid: int = 0) -> ScenarioSamples:
        """See ``ScenarioEvaluator``."""
        return ScenarioSamples(grid, self.samplers[grid].draw(rng, count, width))

    def nominal(self, count: int) -> ScenarioSamples:
        """Return the nominal sample, ``count`` times."""
        return ScenarioSamples(0, np.tile(self.samplers[0].nominal, (count, 1)))

    def value(self, Z: Array, drawn: ScenarioSamples, smoothing: float) -> Values:
        """See ``ScenarioEvaluator``."""
        return self.evaluators[drawn.grid].sample_values(joined(Z, drawn), smoothing)

    def gradient(
        self, Z: Array, drawn: ScenarioSamples, smoothing: float, adjoint_discount: float = 0.0, horizon: float = inf
    ) -> Values:
        """See ``ScenarioEvaluator``."""
        simulation = self.samplers[drawn.grid].problem.simulation
        discount = 1 - exp(-adjoint_discount * simulation.dt)
        skipped = max(0, simulation.steps - round(min(horizon, simulation.duration) / simulation.dt))
        found = self.evaluators[drawn.grid].sample_gradients(joined(Z, drawn), smoothing, discount, skipped)
        assert found.gradient is not None, "gradients were asked for"
        return replace(found, gradient=np.ascontiguousarray(found.gradient[:, : Z.shape[1]]))


class NominalEvaluator(WithoutResiduals):
    """Evaluates points in the nominal sample; see ``Evaluator``."""

    def __init__(self, scenario: SampledEvaluator) -> None:
        """By what evaluates samples."""
        self.scenario = scenario

    def value(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.scenario.value(Z, self.scenario.nominal(len(Z)), smoothing)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.scenario.gradient(Z, self.scenario.nominal(len(Z)), smoothing)


def joined(Z: Array, drawn: ScenarioSamples) -> Array:
    """(batch, n + s)."""
    return np.hstack([np.broadcast_to(Z, (len(drawn.numbers), Z.shape[1])), drawn.numbers])


def values(outputs: Outputs, gradient: Array | None = None) -> Values:
    """From what a kernel gives."""
    alive = outputs["alive"][:, 0] if "alive" in outputs else None
    return Values(*common(outputs), gradient=gradient, alive=alive)
