"""The transcription of a problem with large nets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from symphys.codegen import KernelUnavailable, ProgramError
from symphys.codegen.backends import BEST, PRECISIONS, Description, described
from symphys.codegen.cuda import DeviceKernel
from symphys.records import dataclass
from symphys.transcription.gradient_probe import Probe
from symphys.transcription.judge import Assessment, assessment
from symphys.transcription.network_rollout.context import RolloutContext
from symphys.transcription.network_rollout.evaluator import LargeEvaluator, LargeProbe
from symphys.transcription.network_rollout.forward_backward import ForwardPass, back, objective_arguments
from symphys.transcription.recorded_parts import RolloutArrays
from symphys.transcription.simulation import Record, simulate
from symphys.transcription.transcription import Transcription, gradient_prices
from symphys.types import Array

if TYPE_CHECKING:
    pass

INTERPRETED_BACKENDS = ("casadi", "c")
NET_PRECISIONS = {"double": np.float64, "single": np.float32}
STEP_BACKENDS = {BEST: "simd", "simd": "simd", "simd32": "simd", "cuda": "cuda", "cuda32": "cuda"}
"""The backend of the steps by that of the problem."""


@dataclass(frozen=True, eq=False)
class LargeTranscription(Transcription):
    """A ``Transcription`` whose ``rollout`` is that of the problem without its large nets.

    Attributes:
        context: the data of its rollouts.
    """

    context: RolloutContext

    def judge(self, z: Array, smoothing: float = 0.0) -> Assessment:
        """Implement ``Transcription.judge``."""
        motion = self._plain.forward_pass(z, smoothing)
        _, objective, errors, costs, outputs = (
            np.array(part).ravel()
            for part in self.context.objectives.value.call(objective_arguments(self.context, motion, 0))
        )
        return assessment(self.problem, float(objective[0]), costs, errors, outputs)

    def errors(self, Z: Array) -> Array:
        """Implement ``Transcription.errors``."""
        return np.array([[check.ratio for check in self.judge(z).checks] for z in Z])

    @property
    def quick_motions(self) -> bool:
        """Implement ``Transcription.quick_motions``."""
        return False

    def record(self, z: Array, smoothing: float = 0.0) -> Record:
        """Implement ``Transcription.record``."""
        motion = self._plain.forward_pass(z, smoothing)
        found = simulate(self.rollout, lambda *_: self._happened(motion, smoothing), motion.z[0], smoothing)
        return replace(found, z=np.asarray(z, float))

    def arrays(self, z: Array, smoothing: float = 0.0) -> RolloutArrays:
        """Implement ``Transcription.arrays``."""
        return self.record(z, smoothing).arrays

    def prices(
        self, kinds: Iterable[str] = ("gradient",), clock: Callable[[], float] = perf_counter
    ) -> dict[str, float]:
        """Implement ``Transcription.prices``."""
        return gradient_prices(self.shooting, kinds, clock)

    @cached_property
    def probe(self) -> Probe:
        """Implement ``Transcription.probe``."""
        return LargeProbe(self._plain)

    def back(self, record: Record, ends: Array) -> Iterator[Array]:
        """Implement ``Transcription.back``."""
        plain, smoothing = self._plain, record.arrays.smoothing
        motion = plain.forward_pass(record.z, smoothing)
        return back(self.context, plain.batch_step, plain.nets_at(record.z), motion, smoothing, ends)

    def pull(self, record: Record, states: Mapping[int, Array], parameters: Array) -> Array | None:
        """Implement ``Transcription.pull``."""
        return None

    @cached_property
    def _plain(self) -> LargeEvaluator:
        """The judge's evaluator, on casadi's virtual machine."""
        return LargeEvaluator(self.context, self.context.plain, 1)

    def _happened(self, motion: ForwardPass, smoothing: float) -> list[Any]:
        """Return the results of ``recorder`` for the first robot."""
        step, steps = self.rollout.report, self.rollout.steps
        x, u, given, p = motion.x[:, 0].T, motion.u[:, 0].T, motion.given[:, 0].T, motion.p[0]
        _, *happened = step.map(steps)(x[:, :-1], u, np.tile(p[:, None], steps), smoothing)
        return [x, u, given, p[:, None], *happened]


def evaluator_or_plain(
    context: RolloutContext, exact: bool, backend: str, threads: int
) -> tuple[LargeEvaluator, Description]:
    """Return the requested evaluator, or casadi's with a note."""
    if backend in INTERPRETED_BACKENDS:
        return LargeEvaluator(context, context.plain, threads), Description("casadi", threads=threads)
    try:
        return large_evaluator(context, exact, backend, threads)
    except (KernelUnavailable, ProgramError) as error:
        note = f"casadi's virtual machine evaluates, which is slower: {error}"
        return LargeEvaluator(context, context.plain, threads), Description("casadi", threads=threads, note=note)


def large_evaluator(
    context: RolloutContext, exact: bool, backend: str, threads: int
) -> tuple[LargeEvaluator, Description]:
    """Return an evaluator whose steps are a double-precision kernel; KernelUnavailable if that fails."""
    began = perf_counter()
    step = context.compiled(exact, STEP_BACKENDS[backend])
    kernel, precision = step.kernel, PRECISIONS[backend]
    device = kernel.device if isinstance(kernel, DeviceKernel) else None
    shared, nets = threads if device is None else 1, "nets by matrix products"
    if precision == "single":
        nets += " in single precision, steps in double"
    if device is not None and (lack := device.lacks()):
        device, nets = None, f"{nets}, which the processor computes: {lack}"
    description = replace(described(kernel, perf_counter() - began, precision, nets), threads=shared)
    return LargeEvaluator(context, step, shared, NET_PRECISIONS[precision], device), description
