"""Evaluates points in samples of scenarios by kernels whose decision vector is z with all that differs behind it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import exp, inf

import numpy as np

from symphys.codegen import Kernel
from symphys.codegen.backends.simd import common, probed
from symphys.codegen.runtime.kernel import Outputs
from symphys.shooting import ScenarioSamples, Values, WithoutResiduals
from symphys.transcription.randomization.sampler import Sampler
from symphys.types import Array


class KernelScenarioEvaluator:
    """See ``ScenarioEvaluator``: a sampler and a kernel for each grid."""

    def __init__(self, grids: Sequence[str], samplers: Sequence[Sampler], kernels: Sequence[Kernel]) -> None:
        """Kernels of the samplers' problems, the merit seeded."""
        self.grids, self.samplers, self.kernels = tuple(grids), tuple(samplers), tuple(kernels)

    def draw(self, rng: np.random.Generator, count: int, width: float = 1.0, grid: int = 0) -> ScenarioSamples:
        """See ``ScenarioEvaluator``."""
        return ScenarioSamples(grid, self.samplers[grid].draw(rng, count, width))

    def nominal(self, count: int) -> ScenarioSamples:
        """The nominal sample, ``count`` times."""
        return ScenarioSamples(0, np.tile(self.samplers[0].nominal, (count, 1)))

    def value(self, Z: Array, drawn: ScenarioSamples, smoothing: float) -> Values:
        """See ``ScenarioEvaluator``."""
        kernel = self.kernels[drawn.grid]
        outputs = kernel.forward(joined(Z, drawn), [smoothing])
        return replace(values(outputs), probe=probed(kernel, outputs))

    def gradient(
        self, Z: Array, drawn: ScenarioSamples, smoothing: float, adjoint_discount: float = 0.0, horizon: float = inf
    ) -> Values:
        """See ``ScenarioEvaluator``."""
        simulation = self.samplers[drawn.grid].problem.simulation
        discount = 1 - exp(-adjoint_discount * simulation.dt)
        skipped = max(0, simulation.steps - round(min(horizon, simulation.duration) / simulation.dt))
        outputs, slopes = self.kernels[drawn.grid].gradient(joined(Z, drawn), [1.0], [smoothing], discount, skipped)
        return values(outputs, np.ascontiguousarray(slopes[:, : Z.shape[1]]))


class NominalEvaluator(WithoutResiduals):
    """Evaluates points in the nominal sample; see ``Evaluator``."""

    def __init__(self, scenario: KernelScenarioEvaluator) -> None:
        """By the same kernels."""
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
