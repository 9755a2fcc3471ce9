"""A kernel as casadi functions of one z, so that IPOPT calls compiled code without Python in between."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import casadi as ca

from symphys import codegen as kernel
from symphys.codegen import Fixed, KernelUnavailable, ProcessorKernel
from symphys.codegen.backends.interface import Function
from symphys.codegen.backends.seeds import Seeds
from symphys.codegen.toolchain.build import temporary_folder
from symphys.codegen.toolchain.processes import ELSEWHERE
from symphys.shooting import Nlp
from symphys.types import Array

ROOM = "symphys.codegen.backends"
NAMES = ("nlp", "nlp_gradient", "nlp_jacobian")


class Task(ctypes.Structure):
    """One of the tasks of external.c."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("evaluate", "program", "batch", "memory", "z", "parameters")),
        ("results", ctypes.c_void_p * 2),
    )


class External:
    """The functions of external.c over a kernel; they work as long as this lives."""

    def __init__(self, made: ProcessorKernel, rows: Seeds | None) -> None:
        """``rows``: of the constraints, where there are any."""
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
    """Objective and constraints by the kernel; ``rows``: of the constraints, where there are any.

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
    """The functions, bound to their tasks. A library loaded from a copy has a binding of its own."""
    head = "".join(f"#define {name} {size}\n" for name, size in sizes.items())
    text = head + files(ROOM).joinpath("external.c").read_text(encoding="utf-8")
    with (
        kernel.shared_library([kernel.SourceFile(text)], kernel.default_cache()) as built,
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
    """(z, smoothing) -> (constraints, Jacobian (m, n)) from the gradients of the lanes (n, lanes)."""
    m, n = rows.shape
    z, smoothing = ca.MX.sym("z", n), ca.MX.sym("smoothing")
    constraints, lanes = slopes(z, smoothing)
    pattern = ca.Sparsity.triplet(m, n, rows.rows.tolist(), rows.columns.tolist())
    nonzeros = ca.vec(lanes)[(rows.lanes * n + rows.columns).tolist()]
    jacobian = ca.MX(pattern, nonzeros)
    return ca.Function("nlp_jacobian", [z, smoothing], [constraints, jacobian])
