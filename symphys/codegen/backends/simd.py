"""Kernels: a rollout in each lane or thread, derivatives by adjoints, Jacobians by a lane for each seed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from symphys.codegen import Kernel, KernelUnavailable, ProcessorKernel
from symphys.codegen.backends.casadi_ import squared
from symphys.codegen.backends.interface import Backend, BackendSource, Function, joined
from symphys.codegen.backends.kernels import build_kernel, described
from symphys.codegen.backends.seeds import Seeds
from symphys.codegen.runtime.kernel import Outputs
from symphys.codegen.toolchain.warm_start import ProgramSource
from symphys.shooting import LaterNlp, Nlp, Values
from symphys.types import Array

SEEDED = ("merit", "objective", "residuals", "constraints")


class KernelEvaluator:
    """Evaluates with a kernel; see ``Evaluator``."""

    def __init__(self, kernel: Kernel, rows: Callable[[], Seeds] | None, exact: bool) -> None:
        """``rows``: of the residuals, where there are any; ``exact``: for smoothing 0 only."""
        self.kernel, self.rows, self.exact = kernel, rows, exact
        self.steepest = Seeds.whole(kernel, "merit").words[0]

    def parameters(self, smoothing: float) -> tuple[float]:
        """The kernel's parameters."""
        if self.exact and smoothing != 0:
            raise ValueError(f"this kernel is for smoothing 0 only, not for {smoothing:g}")
        return (smoothing,)

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        outputs = self.kernel.forward(Z, self.parameters(smoothing))
        return Values(*common(outputs), probe=probed(self.kernel, outputs))

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``."""
        outputs, gradient = self.kernel.gradient(Z, self.steepest, self.parameters(smoothing))
        return Values(*common(outputs), gradient=gradient)

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.residuals``."""
        outputs = self.kernel.forward(Z, self.parameters(smoothing))
        r = outputs["residuals"]
        return Values(squared(r), *common(outputs)[1:], residuals=r)

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.jacobian``."""
        assert self.rows is not None, "a problem without residuals has no Jacobian"
        rows = self.rows()
        seeds = rows.words
        outputs, slopes = self.kernel.gradient(
            np.repeat(Z, len(seeds), axis=0), np.tile(seeds, (len(Z), 1)), self.parameters(smoothing)
        )
        first = {name: each[:: len(seeds)] for name, each in outputs.items()}
        r = np.ascontiguousarray(first["residuals"])
        jacobian = rows.spread(slopes.reshape(len(Z), len(seeds), Z.shape[1]))
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
    kernel = build_kernel(name, ProgramSource(source.program, source.identity), SEEDED, threads)
    asked = {"residuals": (lambda: source.functions.residuals, 0), "constraints": (lambda: source.functions.nlp, 1)}
    rows = {
        output: cache(partial(Seeds.compressed, kernel, output, *asked[output]))
        for output in asked
        if output in kernel.program.outputs
    }
    nlp = LaterNlp(lambda: Nlp(source.functions.nlp))
    told: list[str] = []
    if isinstance(kernel, ProcessorKernel):
        nlp = LaterNlp(lambda: _nlp(kernel, source.functions.nlp, rows.get("constraints"), told))
    found = described(kernel, time.perf_counter() - began)
    said = found.later
    evaluator = KernelEvaluator(kernel, rows.get("residuals"), source.exact)
    return Backend(replace(found, later=lambda: joined(said(), *told)), evaluator, nlp)


def _nlp(kernel: ProcessorKernel, expression: Function, rows: Callable[[], Seeds] | None, told: list[str]) -> Nlp:
    """Objective and constraints by the kernel, or by the expression, and why is added to ``told``."""
    from symphys.codegen.backends.external import external_nlp

    try:
        return external_nlp(kernel, expression, rows and rows())
    except KernelUnavailable as error:
        told.append(f"for ipopt casadi's virtual machine evaluates, which is slower: {error}")
        return Nlp(expression)
