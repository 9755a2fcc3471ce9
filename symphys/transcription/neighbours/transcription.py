"""The transcription of a problem of many bodies, whose steps find the pairs that are near."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter
from typing import ClassVar, NoReturn

import numpy as np
from numpy.typing import NDArray

from symphys.codegen import KernelUnavailable
from symphys.codegen.backends import Description
from symphys.errors import SymphysError
from symphys.problem import Problem
from symphys.shooting import Nlp, ShootingProblem, Values, WithoutResiduals
from symphys.transcription.decision_variables import blocks
from symphys.transcription.functions import ExpressionFunctions
from symphys.transcription.gradient_probe import Probe
from symphys.transcription.judge import Assessment, assessment
from symphys.transcription.neighbours.context import CrowdContext
from symphys.transcription.objective import limits
from symphys.transcription.simulation import Record, simulate
from symphys.transcription.transcription import Transcription, gradient_prices

Array = NDArray[np.float64]


class CrowdEvaluator(WithoutResiduals):
    """See ``Evaluator``."""

    def __init__(self, context: CrowdContext) -> None:
        """What a problem is computed with."""
        self.context = context

    def value(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return values(self.context.evaluated(Z, smoothing)[0])

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        parts, gradient = self.context.evaluated(Z, smoothing, self.context.slopes)
        return replace(values(parts), gradient=gradient)


def values(parts: list[Array]) -> Values:
    """From those of ``CrowdContext.value``."""
    merit, objective, errors, outputs, _, probe = parts
    return Values(merit[:, 0], objective[:, 0], errors, outputs, probe=probe[:, 0])


class CrowdProbe:
    """See ``Probe``."""

    def __init__(self, context: CrowdContext) -> None:
        """By what solvers' gradients are made of."""
        self._context = context

    def values(self, Z: Array) -> Array:
        """See ``Probe``."""
        *_, number = self._context.evaluated(Z, 0.0)[0]
        return np.asarray(number[:, 0])

    def gradient(self, z: Array) -> Array:
        """See ``Probe``."""
        _, slopes = self._context.evaluated(np.asarray(z, float)[None], 0.0, self._context.probe_slopes)
        return np.asarray(slopes[0])


@dataclass(frozen=True, eq=False)
class CrowdTranscription(Transcription):
    """See ``Transcription``; forces of contacts are not recorded.

    Attributes:
        context: what it is computed with.
    """

    context: CrowdContext
    records_contacts: ClassVar[bool] = False

    def judge(self, z: Array, smoothing: float = 0.0) -> Assessment:
        """See ``Transcription``."""
        parts, _ = self.context.evaluated(np.asarray(z, float)[None], smoothing)
        _, objective, errors, outputs, costs, _ = (part[0] for part in parts)
        return assessment(self.problem, float(objective[0]), costs, errors, outputs)

    def record(self, z: Array, smoothing: float = 0.0) -> Record:
        """See ``Transcription``."""
        return simulate(self.rollout, self._happened, z, smoothing)

    def motion(self, z: Array, x: Array, u: Array) -> NoReturn:
        """See ``Transcription``; SymphysError, since a motion cannot go on without its contacts' forces."""
        raise SymphysError(NOT_KNOWN)

    def prices(
        self, kinds: Iterable[str] = ("gradient",), clock: Callable[[], float] = perf_counter
    ) -> dict[str, float]:
        """See ``Transcription``."""
        return gradient_prices(self.shooting, kinds, clock)

    @cached_property
    def probe(self) -> Probe:
        """See ``Transcription``."""
        return CrowdProbe(self.context)

    def back(self, record: Record, ends: Array) -> Iterator[Array]:
        """See ``Transcription``; SymphysError, since forces of contacts are no part of a state."""
        raise SymphysError(NOT_KNOWN)

    def pull(self, record: Record, states: Mapping[int, Array], parameters: Array) -> Array | None:
        """See ``Transcription``."""
        return None

    def _happened(self, z: Array, smoothing: float) -> list[Array]:
        """What ``recorder`` gives; residuals and counts are not known."""
        steps = self.rollout.steps
        (x,) = self.context.states(np.asarray(z, float)[None], smoothing)
        none, unknown = np.zeros((0, steps)), np.full((1, steps), np.nan)
        given = np.zeros((self.rollout.given.shape[0], steps))
        return [x.T, given, given, np.zeros((0, 1)), none, none, *[unknown] * 4]


NOT_KNOWN = "of many bodies that find their pairs only whole motions are known, without the forces of contacts"


def transcribe_crowd(problem: Problem, threads: int | None = None) -> CrowdTranscription:
    """See ``transcribe``; the steps are a kernel for the processor, of exact contacts."""
    began = perf_counter()
    try:
        context = CrowdContext(problem, threads)
    except KernelUnavailable as error:
        raise SymphysError(f"steps of many bodies need a compiler: {error}") from error
    report, asked = context.kernel.report, context.terms
    shooting = ShootingProblem(
        name=problem.name,
        blocks=blocks(problem),
        evaluator=CrowdEvaluator(context),
        nlp=Nlp(None),
        squares=False,
        constraint_names=asked.names,
        constraint_lower=asked.lower,
        constraint_upper=asked.upper,
        limits=limits(problem),
        smoothing=problem.simulation.smoothing,
        stop_when_met=problem.stop_when_met,
        output_names=tuple(output.label for output in problem.outputs),
    )
    description = Description(
        name="simd",
        lanes=report.lanes,
        threads=context.kernel.threads,
        compiler=report.compiler,
        cached=report.cached,
        seconds=report.seconds,
        note="each step finds the pairs that are near",
        flags=report.flags,
    )
    built = perf_counter() - began - report.seconds
    functions = ExpressionFunctions(context.rollout, asked)
    return CrowdTranscription(problem, context.rollout, functions, shooting, description, built, context)
