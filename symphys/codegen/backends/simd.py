"""Kernels as backends: a rollout in each lane or thread, derivatives by adjoints, Jacobians by a lane for each seed.

IPOPT calls the kernel as casadi functions of one z (external.c), without Python in between.
"""

from __future__ import annotations

import ctypes
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from importlib.resources import files
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys import codegen
from symphys.codegen import Fixed, Kernel, KernelUnavailable, ProcessorKernel
from symphys.codegen.backends.casadi_ import squared
from symphys.codegen.backends.interface import Backend, BackendSource, Function, joined
from symphys.codegen.backends.kernels import build_kernel, described
from symphys.codegen.runtime.kernel import Outputs
from symphys.codegen.toolchain.libraries import temporary_folder
from symphys.codegen.toolchain.processes import ELSEWHERE
from symphys.codegen.toolchain.warm_start import ProgramSource
from symphys.records import dataclass
from symphys.shooting import LaterNlp, Nlp, Values
from symphys.types import Array

SEEDED = ("merit", "objective", "residuals", "constraints")
ROOM = "symphys.codegen.backends"
NAMES = ("nlp", "nlp_gradient", "nlp_jacobian")


@dataclass(frozen=True)
class Seeds:
    """Seeds of a Jacobian (m, n): rows that share no variable share a lane (Curtis, Powell, Reid 1974).

    Attributes:
        words: (lanes, seeded words) the seed of each lane.
        shape: (m, n).
        rows, columns: (nonzeros,) where the Jacobian may differ from zero, column after column.
        lanes: (nonzeros,) the lane that tells each.
    """

    words: Array
    shape: tuple[int, int]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    lanes: NDArray[np.int64]

    @classmethod
    def whole(cls, kernel: Kernel, name: str) -> Seeds:
        """Give each row a lane of its own."""
        m, n = kernel.program.outputs[name].size, kernel.program.z.size
        columns, rows = np.divmod(np.arange(m * n), m)
        return cls(_words(kernel, name, np.eye(m)), (m, n), rows, columns, rows)

    @classmethod
    def compressed(cls, kernel: Kernel, name: str, function: Callable[[], Function], index: int) -> Seeds:
        """Color the sparsity of the result ``index`` of ``function()`` into as few lanes as possible."""
        m, n = kernel.program.outputs[name].size, kernel.program.z.size
        if m <= kernel.report.lanes:
            return cls.whole(kernel, name)
        sparsity = function().jac_sparsity(index, 0)
        shared = sparsity.T.uni_coloring()  # (m, lanes): a nonzero where a row goes into a lane
        row, lane = (np.array(part, dtype=np.int64) for part in (shared.get_triplet()))
        lane_of = np.zeros(m, dtype=np.int64)
        lane_of[row] = lane
        seeds = np.zeros((shared.size2(), m))
        seeds[lane, row] = 1
        rows, columns = (np.array(part, dtype=np.int64) for part in sparsity.get_triplet())
        return cls(_words(kernel, name, seeds), (m, n), rows, columns, lane_of[rows])

    def spread(self, slopes: Array) -> Array:
        """Return the Jacobians (batch, m, n) from the lanes' gradients (batch, lanes, n)."""
        jacobian = np.zeros((len(slopes), *self.shape))
        jacobian[:, self.rows, self.columns] = slopes[:, self.lanes, self.columns]
        return jacobian


def _words(kernel: Kernel, name: str, seeds: Array) -> Array:
    """Return the seeds of one output among those of all that can be differentiated."""
    sizes = [kernel.program.outputs[other].size for other in kernel.seeded]
    start = sum(sizes[: kernel.seeded.index(name)])
    words = np.zeros((len(seeds), sum(sizes)))
    words[:, start : start + seeds.shape[1]] = seeds
    return words


class Task(ctypes.Structure):
    """A task of external.c: an evaluation at fixed addresses."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("evaluate", "program", "batch", "memory", "z", "parameters")),
        ("results", ctypes.c_void_p * 2),
    )


class External:
    """The functions of external.c over a kernel; they work as long as this lives."""

    def __init__(self, made: ProcessorKernel, rows: Seeds | None) -> None:
        """Bind a kernel; ``rows``: of the constraints, where there are any."""
        seeds = [Seeds.whole(made, "objective").words, *([rows.words] if rows else [])]
        self.fixed = [made.fixed(), *map(made.fixed, seeds)]
        part = made.program.output_slices()
        objective, constraints = part["objective"], part.get("constraints", slice(0, 0))
        value, gradient = self.fixed[:2]
        tasks = [
            task(value, value.outputs[0, objective], value.outputs[0, constraints]),
            task(gradient, gradient.outputs[0, objective], gradient.gradient),
        ]
        if rows:
            slopes = self.fixed[2]
            tasks.append(task(slopes, slopes.outputs[0, constraints], slopes.gradient))
        sizes = {"N": made.program.z.size, "M": rows.shape[0] if rows else 0, "L": len(rows.words) if rows else 1}
        self.functions = load(sizes, tasks)


def external_nlp(made: ProcessorKernel, expression: Function, rows: Seeds | None) -> Nlp:
    """Return objective and constraints by the kernel; ``rows``: of the constraints, where there are any.

    KernelUnavailable where there is no room for the library, or none that may be loaded.
    """
    external = External(made, rows)
    value, gradient, slopes = external.functions
    jacobian = sparse(slopes, rows) if rows else None
    return Nlp(expression, value, gradient, jacobian, keep=external)


def task(fixed: Fixed, first: Array, second: Array) -> Task:
    """Return the data of an evaluation for external.c; the results are views of its arrays."""
    results = (ctypes.c_void_p * 2)(first.ctypes.data, second.ctypes.data)
    return Task(*fixed.addresses, fixed.z.ctypes.data, fixed.parameters.ctypes.data, results)


def load(sizes: dict[str, int], tasks: Sequence[Task]) -> list[Function]:
    """Return the functions, bound to their tasks. A library loaded from a copy has a binding of its own."""
    head = "".join(f"#define {name} {size}\n" for name, size in sizes.items())
    text = head + files(ROOM).joinpath("external.c").read_text(encoding="utf-8")
    with (
        codegen.shared_library([codegen.SourceFile(text)], codegen.default_cache()) as built,
        temporary_folder("symphys-external-") as folder,
    ):
        copy = Path(folder) / "external.so"
        try:
            shutil.copyfile(built.path, copy)
            library = ctypes.CDLL(str(copy))
        except OSError as error:
            raise KernelUnavailable(f"{copy} cannot be used: {error.strerror or error}; {ELSEWHERE}") from error
        functions = [ca.external(name, str(copy)) for name in NAMES]
        library.bind((Task * 3)(*tasks))
    return functions


def sparse(slopes: Function, rows: Seeds) -> Function:
    """Return (z, smoothing) -> (constraints, Jacobian (m, n)) from the gradients of the lanes (n, lanes)."""
    m, n = rows.shape
    z, smoothing = ca.MX.sym("z", n), ca.MX.sym("smoothing")
    constraints, lanes = slopes(z, smoothing)
    pattern = ca.Sparsity.triplet(m, n, rows.rows.tolist(), rows.columns.tolist())
    nonzeros = ca.vec(lanes)[(rows.lanes * n + rows.columns).tolist()]
    jacobian = ca.MX(pattern, nonzeros)
    return ca.Function("nlp_jacobian", [z, smoothing], [constraints, jacobian])


class KernelEvaluator:
    """Evaluates with a kernel; see ``Evaluator``."""

    def __init__(self, kernel: Kernel, rows: Callable[[], Seeds] | None, exact: bool) -> None:
        """Bind a kernel; ``rows``: of the residuals, if any; ``exact``: for smoothing 0 only."""
        self.kernel, self.rows, self.exact = kernel, rows, exact
        self.steepest = Seeds.whole(kernel, "merit").words[0]

    def parameters(self, smoothing: float) -> tuple[float]:
        """Return the kernel's parameters."""
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
    """Return the number (batch,) whose gradient is examined; None in single precision, which has no differences."""
    return outputs["probe"][:, 0] if "probe" in outputs and kernel.report.precision == "double" else None


def common(outputs: Outputs) -> tuple[Array, Array, Array, Array]:
    """Return merits, objectives, errors and outputs."""
    merit = outputs["merit"]
    none = merit[:, :0]
    return merit[:, 0], outputs["objective"][:, 0], outputs.get("errors", none), outputs.get("outputs", none)


def by_kernel(source: BackendSource, threads: int, name: str) -> Backend:
    """Compile the problem's program for a backend of ``PRECISIONS``; KernelUnavailable if that cannot be."""
    if source.program is None:
        raise KernelUnavailable("this problem has no program to compile")
    began = time.perf_counter()
    kernel = build_kernel(name, ProgramSource(source.program, source.identity), SEEDED, threads)
    of_output = {"residuals": (lambda: source.functions.residuals, 0), "constraints": (lambda: source.functions.nlp, 1)}
    rows = {
        output: cache(partial(Seeds.compressed, kernel, output, *of_output[output]))
        for output in of_output
        if output in kernel.program.outputs
    }
    nlp = LaterNlp(lambda: Nlp(source.functions.nlp))
    notes: list[str] = []
    if isinstance(kernel, ProcessorKernel):
        nlp = LaterNlp(lambda: _nlp(kernel, source.functions.nlp, rows.get("constraints"), notes))
    found = described(kernel, time.perf_counter() - began)
    said = found.later
    evaluator = KernelEvaluator(kernel, rows.get("residuals"), source.exact)
    return Backend(replace(found, later=lambda: joined(said(), *notes)), evaluator, nlp)


def _nlp(kernel: ProcessorKernel, expression: Function, rows: Callable[[], Seeds] | None, notes: list[str]) -> Nlp:
    """Return objective and constraints by the kernel; else by the expression, and add the reason to ``notes``."""
    try:
        return external_nlp(kernel, expression, rows and rows())
    except KernelUnavailable as error:
        notes.append(f"for ipopt casadi's virtual machine evaluates, which is slower: {error}")
        return Nlp(expression)
