"""Kernels: a rollout in each lane or thread, derivatives by adjoints, Jacobians by a lane for each seed."""

from __future__ import annotations

import time

import numpy as np

from symphys.codegen import Kernel, KernelUnavailable, ProcessorKernel
from symphys.codegen.backends.casadi_ import squared
from symphys.codegen.backends.external import external_nlp
from symphys.codegen.backends.interface import Backend, BackendSource
from symphys.codegen.backends.kernels import build_kernel, described
from symphys.codegen.backends.seeds import Seeds
from symphys.codegen.runtime.kernel import Outputs
from symphys.shooting import Array, Nlp, Values

SEEDED = ("merit", "objective", "residuals", "constraints")


class KernelEvaluator:
    """Evaluates with a kernel; see ``Evaluator``."""

    def __init__(self, kernel: Kernel, rows: Seeds | None, exact: bool) -> None:
        """``rows``: of the residuals, where there are any; ``exact``: for smoothing 0 only."""
        self.kernel, self.rows, self.exact = kernel, rows, exact
        self.steepest = Seeds.whole(kernel, "merit").words[0]

    def parameters(self, smoothing: float) -> tuple[float]:
        """The kernel's parameters."""
        if self.exact and smoothing != 0:
            raise ValueError(f"this kernel is for smoothing 0 only, not for {smoothing:g}")
        return (smoothing,)

    def value(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        outputs = self.kernel.forward(Z, self.parameters(smoothing))
        return Values(*common(outputs), probe=probed(self.kernel, outputs))

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        outputs, gradient = self.kernel.gradient(Z, self.steepest, self.parameters(smoothing))
        return Values(*common(outputs), gradient=gradient)

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        outputs = self.kernel.forward(Z, self.parameters(smoothing))
        r = outputs["residuals"]
        return Values(squared(r), *common(outputs)[1:], residuals=r)

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        assert self.rows is not None, "a problem without residuals has no Jacobian"
        seeds = self.rows.words
        outputs, slopes = self.kernel.gradient(
            np.repeat(Z, len(seeds), axis=0), np.tile(seeds, (len(Z), 1)), self.parameters(smoothing)
        )
        first = {name: rows[:: len(seeds)] for name, rows in outputs.items()}
        r = np.ascontiguousarray(first["residuals"])
        jacobian = self.rows.spread(slopes.reshape(len(Z), len(seeds), Z.shape[1]))
        return Values(squared(r), *common(first)[1:], residuals=r, jacobian=jacobian)


def probed(kernel: Kernel, outputs: Outputs) -> Array | None:
    """(batch,) of the number whose gradient is examined; None in single precision, which cannot be differenced."""
    return outputs["probe"][:, 0] if "probe" in outputs and kernel.report.precision == "double" else None


def common(outputs: Outputs) -> tuple[Array, Array, Array, Array]:
    """Merits, objectives, errors, and what is told."""
    merit = outputs["merit"]
    none = merit[:, :0]
    return merit[:, 0], outputs["objective"][:, 0], outputs.get("errors", none), outputs.get("outputs", none)


def by_kernel(source: BackendSource, threads: int, name: str) -> Backend:
    """Compile the problem's program for a backend of ``PRECISIONS``; KernelUnavailable if that cannot be."""
    if source.program is None:
        raise KernelUnavailable("this problem has no program to compile")
    began = time.perf_counter()
    program = source.program()
    kernel = build_kernel(name, program, [name for name in SEEDED if name in program.outputs], threads)
    rows = {
        output: Seeds.compressed(kernel, output, function, index)
        for output, function, index in (
            ("residuals", source.functions.residuals, 0),
            ("constraints", source.functions.nlp, 1),
        )
        if output in program.outputs
    }
    nlp, note = Nlp(source.functions.nlp), ""
    if isinstance(kernel, ProcessorKernel):
        try:
            nlp = external_nlp(kernel, source.functions.nlp, rows.get("constraints"))
        except KernelUnavailable as error:
            note = f"for ipopt casadi's virtual machine evaluates, which is slower: {error}"
    evaluator = KernelEvaluator(kernel, rows.get("residuals"), source.exact)
    return Backend(described(kernel, time.perf_counter() - began, note=note), evaluator, nlp)
