"""Kernels of SIMD lanes: a rollout in each lane, derivatives by adjoints, Jacobians by a lane for each seed."""

from __future__ import annotations

import time
from typing import Literal

import numpy as np

from symphys.backends.casadi_ import squared
from symphys.backends.external import external_nlp
from symphys.backends.interface import Backend, Description, Source
from symphys.backends.seeds import Seeds
from symphys.kernel import Kernel, KernelUnavailable, compile_program
from symphys.kernel.kernel import Outputs
from symphys.shooting import Array, Values

SEEDED = ("merit", "objective", "residuals", "constraints")


class KernelEvaluator:
    """Evaluates with a kernel; see ``Evaluator``."""

    def __init__(self, kernel: Kernel, rows: Seeds | None, exact: bool) -> None:
        """``rows``: of the residuals, where there are any; ``exact``: for smoothing 0 only."""
        self.kernel, self.rows, self.exact = kernel, rows, exact
        self.steepest = Seeds.whole(kernel, "merit").words[0]

    def knob(self, smoothing: float) -> tuple[float]:
        """The kernel's knob."""
        if self.exact and smoothing != 0:
            raise ValueError(f"this kernel is for smoothing 0 only, not for {smoothing:g}")
        return (smoothing,)

    def value(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        outputs = self.kernel.forward(Z, self.knob(smoothing))
        return Values(*common(outputs), probe=probed(self.kernel, outputs))

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        outputs, gradient = self.kernel.gradient(Z, self.steepest, self.knob(smoothing))
        return Values(*common(outputs), gradient=gradient)

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        outputs = self.kernel.forward(Z, self.knob(smoothing))
        r = outputs["residuals"]
        return Values(squared(r), *common(outputs)[1:], residuals=r)

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        assert self.rows is not None, "a problem without residuals has no Jacobian"
        seeds = self.rows.words
        outputs, slopes = self.kernel.gradient(
            np.repeat(Z, len(seeds), axis=0), np.tile(seeds, (len(Z), 1)), self.knob(smoothing)
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


def simd32(source: Source, threads: int) -> Backend:
    """The same in single precision: twice the lanes; gradients agree with double precision to 1e-6 to 1e-4."""
    return simd(source, threads, "single")


def simd(source: Source, threads: int, precision: Literal["double", "single"] = "double") -> Backend:
    """Compile the problem's program; KernelUnavailable if that cannot be. ``threads`` share the blocks of a batch."""
    if source.program is None:
        raise KernelUnavailable("this problem has no program to compile")
    began = time.perf_counter()
    program = source.program()
    seeded = [name for name in SEEDED if name in program.outputs]
    kernel = compile_program(program, seeded=seeded, threads=threads, precision=precision)
    rows = {
        name: Seeds.compressed(kernel, name, function, index)
        for name, function, index in (
            ("residuals", source.functions.residuals, 0),
            ("constraints", source.functions.nlp, 1),
        )
        if name in program.outputs
    }
    nlp = external_nlp(kernel, source.functions.nlp, rows.get("constraints"))
    report, spent = kernel.report, time.perf_counter() - began
    told = Description(
        "simd" if precision == "double" else "simd32",
        report.lanes,
        threads,
        report.precision,
        report.compiler,
        report.cached,
        spent,
        report.note,
    )
    return Backend(told, KernelEvaluator(kernel, rows.get("residuals"), source.exact), nlp)
