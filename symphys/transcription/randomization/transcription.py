"""The transcription of a problem with scenarios."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import exp, inf
from time import perf_counter
from typing import Protocol

import numpy as np

from symphys.codegen import Kernel, KernelUnavailable, ProgramError, processors
from symphys.codegen.backends import PRECISIONS, Description, build_kernel, described
from symphys.codegen.backends.interface import joined
from symphys.codegen.backends.simd import common, probed
from symphys.codegen.runtime.kernel import Outputs
from symphys.codegen.toolchain.warm_start import ProgramSource
from symphys.problem import Problem
from symphys.shooting import Nlp, ScenarioSamples, Values, WithoutResiduals
from symphys.transcription.network_rollout.context import make_context
from symphys.transcription.network_rollout.partition import has_large_nets
from symphys.transcription.network_rollout.transcription import large_evaluator
from symphys.transcription.program import program_identity, rollout_program
from symphys.transcription.randomization.sampler import Sampler
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.transcription import Transcription
from symphys.types import Array


class SampleEvaluator(Protocol):
    """Evaluates rows (B, n + s): points followed by the numbers of a sample."""

    def sample_values(self, rows: Array, smoothing: float) -> Values:
        """Return values without gradients."""
        ...

    def sample_gradients(self, rows: Array, smoothing: float, discount: float, skipped: int) -> Values:
        """Return values with gradients (B, n + s).

        Args:
            rows: see above.
            smoothing: [m/s].
            discount: share of its adjoint that the state loses in each step back, see ``AdjointDiscount``.
            skipped: steps at the end that are not computed.
        """
        ...


class KernelSamples:
    """A ``SampleEvaluator`` by a kernel."""

    def __init__(self, kernel: Kernel) -> None:
        """Wrap a kernel of the sampler's problem whose merit is seeded."""
        self.kernel = kernel

    def sample_values(self, rows: Array, smoothing: float) -> Values:
        """Implement ``SampleEvaluator.sample_values``."""
        outputs = self.kernel.forward(rows, [smoothing])
        return replace(values(outputs), probe=probed(self.kernel, outputs))

    def sample_gradients(self, rows: Array, smoothing: float, discount: float, skipped: int) -> Values:
        """Implement ``SampleEvaluator.sample_gradients``."""
        outputs, slopes = self.kernel.gradient(rows, [1.0], [smoothing], discount, skipped)
        return values(outputs, slopes)


class ScenarioGrids:
    """A ``ScenarioEvaluator``: a sampler and an evaluator for each time grid."""

    def __init__(
        self, grids: Sequence[str], samplers: Sequence[Sampler], evaluators: Sequence[SampleEvaluator]
    ) -> None:
        """Combine the samplers and evaluators of grids, which have names."""
        self.grids, self.samplers, self.evaluators = tuple(grids), tuple(samplers), tuple(evaluators)

    def draw(self, rng: np.random.Generator, count: int, width: float = 1.0, grid: int = 0) -> ScenarioSamples:
        """Implement ``ScenarioEvaluator.draw``."""
        return ScenarioSamples(grid, self.samplers[grid].draw(rng, count, width))

    def nominal(self, count: int) -> ScenarioSamples:
        """Return the nominal sample, ``count`` times."""
        return ScenarioSamples(0, np.tile(self.samplers[0].nominal, (count, 1)))

    def value(self, Z: Array, drawn: ScenarioSamples, smoothing: float) -> Values:
        """Implement ``ScenarioEvaluator.value``."""
        return self.evaluators[drawn.grid].sample_values(_joined(Z, drawn), smoothing)

    def gradient(
        self, Z: Array, drawn: ScenarioSamples, smoothing: float, adjoint_discount: float = 0.0, horizon: float = inf
    ) -> Values:
        """Implement ``ScenarioEvaluator.gradient``."""
        simulation = self.samplers[drawn.grid].problem.simulation
        discount = 1 - exp(-adjoint_discount * simulation.dt)
        skipped = max(0, simulation.steps - round(min(horizon, simulation.duration) / simulation.dt))
        found = self.evaluators[drawn.grid].sample_gradients(_joined(Z, drawn), smoothing, discount, skipped)
        assert found.gradient is not None, "gradients were asked for"
        return replace(found, gradient=np.ascontiguousarray(found.gradient[:, : Z.shape[1]]))


class NominalEvaluator(WithoutResiduals):
    """An ``Evaluator`` in the nominal sample."""

    def __init__(self, scenario: ScenarioGrids) -> None:
        """Wrap an evaluator of samples."""
        self.scenario = scenario

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        return self.scenario.value(Z, self.scenario.nominal(len(Z)), smoothing)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``."""
        return self.scenario.gradient(Z, self.scenario.nominal(len(Z)), smoothing)


def _joined(Z: Array, drawn: ScenarioSamples) -> Array:
    """Return rows (batch, n + s)."""
    return np.hstack([np.broadcast_to(Z, (len(drawn.numbers), Z.shape[1])), drawn.numbers])


def values(outputs: Outputs, gradient: Array | None = None) -> Values:
    """Read the outputs of a kernel."""
    alive = outputs["alive"][:, 0] if "alive" in outputs else None
    return Values(*common(outputs), gradient=gradient, alive=alive)


NO_SAMPLES = "there are no samples of scenarios"


def with_scenarios(
    plain: Transcription, problem: Problem, exact: bool, backend: str, threads: int | None
) -> Transcription:
    """Return ``plain``, transcribed without scenarios, with kernels of the scenarios as its backend.

    Where there can be no kernels it stays as it is, and its backend's note says so.
    """
    began, count = perf_counter(), processors() if threads is None else threads
    assert problem.scenarios is not None, "nothing differs"
    grids = {"": problem.simulation, **{grid.name: grid.simulation for grid in problem.scenarios.discretisations}}
    try:
        if backend not in PRECISIONS:
            raise KernelUnavailable(f"the backend {backend} cannot draw samples of scenarios")
        samplers = [Sampler(replace(problem, simulation=simulation)) for simulation in grids.values()]
        made = [_evaluating(each.problem, exact, backend, count) for each in samplers]
    except (KernelUnavailable, ProgramError) as error:
        description = replace(plain.backend, note=f"{NO_SAMPLES}: {error}")
        return replace(plain, problem=problem, backend=description)
    scenario = ScenarioGrids(list(grids), samplers, [evaluator for evaluator, _ in made])
    shooting = replace(
        plain.shooting, evaluator=NominalEvaluator(scenario), scenario=scenario, squares=False, nlp=Nlp(None)
    )
    note = joined(made[0][1].note, f"{len(grids)} discretisations" if len(grids) > 1 else "")
    cached = all(description.cached for _, description in made)
    description = replace(made[0][1], seconds=perf_counter() - began, note=note, cached=cached)
    return replace(plain, problem=problem, shooting=shooting, backend=description)


def _evaluating(problem: Problem, exact: bool, backend: str, threads: int) -> tuple[SampleEvaluator, Description]:
    """Build the evaluator of one grid: a kernel, or a kernel for steps with large nets between them."""
    if has_large_nets(problem):
        return large_evaluator(make_context(problem), exact, backend, threads)
    source = ProgramSource(lambda: rollout_program(symbolic_rollout(problem), exact), program_identity(problem, exact))
    kernel = build_kernel(backend, source, ("merit",), threads)
    return KernelSamples(kernel), described(kernel, 0.0)
