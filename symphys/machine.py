"""Examine this machine: each capability that symphys uses is tried on a tiny problem."""

from __future__ import annotations

import importlib.metadata
import platform
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import casadi as ca
import numpy as np

from symphys.codegen import (
    Cache,
    FunctionCall,
    Kernel,
    KernelUnavailable,
    MemoryLayout,
    ProcessorKernel,
    Program,
    compile_program,
    default_cache,
    interpret,
)
from symphys.codegen.cuda import compile_on, find_gpu
from symphys.codegen.toolchain.compiler import find_compiler, processor, processors
from symphys.records import dataclass

PACKAGES = ("casadi", "click", "cma", "matplotlib", "numpy", "pydantic", "rich", "scipy")
LINEAR_SOLVERS = ("mumps", "ma27", "ma57", "ma77", "ma86", "ma97", "pardiso", "spral")
WITHOUT = "symphys works without it, by casadi's evaluation, except for scenarios and the export of C"
CLOSE = 1e-12
"""Largest relative difference of a kernel's values from casadi's."""
STEPS, DT, ROWS = 20, 0.05, 37
"""Steps of the pendulum, their length [s], and rows of a batch."""
Z = (0.5, -0.3)
"""The pendulum's first angle [rad] and rate [rad/s]."""

State = Literal["ok", "missing", "failed"]


@dataclass(frozen=True)
class Capability:
    """A capability of this machine.

    Attributes:
        name: such as "compiler", "gpu" or "kernel, values".
        state: "ok", "missing" or "failed".
        text: what was found, or what is wrong and what to do.
        required: whether symphys does not work without it.
    """

    name: str
    state: State
    text: str
    required: bool = False


def examine() -> Iterator[Capability]:
    """Yield all capabilities, each as soon as it was tried."""
    yield Capability("python", "ok", f"{platform.python_version()} on {platform.system()} {platform.machine()}")
    yield _tried("packages", _packages, required=True)
    yield _tried("ipopt", _ipopt, required=True)
    yield _tried("linear solvers", _linear_solvers)
    yield _tried("processor", _processor)
    yield _tried("cache", _cache)
    compiler = _tried("compiler", _compiler)
    yield compiler
    yield _tried("gpu", _gpu)
    if compiler.state == "ok":
        yield from _kernels()
    else:
        yield Capability("kernels", "missing", f"not tried without a compiler; {WITHOUT}")


def doctor() -> list[Capability]:
    """Try what symphys uses on this machine: packages, IPOPT, compiler, GPU, kernels.

    Returns:
        The capabilities, each with ``name``, ``state`` ("ok", "missing" or "failed") and ``text``.

    Example:
        >>> import symphys
        >>> {each.name: each.state for each in symphys.doctor()}["packages"]
        'ok'
    """
    return list(examine())


def healthy(findings: list[Capability]) -> bool:
    """Whether all capabilities that symphys needs work."""
    return all(finding.state == "ok" for finding in findings if finding.required)


class _Missing(Exception):
    """A capability that is not installed; the text says what to install."""


def _tried(name: str, work: Callable[[], str], required: bool = False) -> Capability:
    """Try a capability; whatever it raises becomes part of the report."""
    try:
        return Capability(name, "ok", work(), required)
    except _Missing as error:
        return Capability(name, "missing", str(error), required)
    except Exception as error:
        text = str(error) or type(error).__name__
        return Capability(name, "failed", " ".join(text.split()), required)


def _packages() -> str:
    found, absent = [], []
    for name in PACKAGES:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            absent.append(name)
    if absent:
        raise _Missing(f"{', '.join(absent)}; pip install {' '.join(absent)}")
    return ", ".join(found)


def _ipopt() -> str:
    if not ca.has_nlpsol("ipopt"):
        raise _Missing("casadi has no ipopt: pip install --force-reinstall casadi")
    x = ca.SX.sym("x", 2)
    nlp = {"x": x, "f": ca.sumsqr(x - 1), "g": x[0] + x[1]}
    solver = ca.nlpsol("tiny", "ipopt", nlp, {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"})
    found = np.array(solver(x0=[0, 0], ubg=1)["x"]).ravel()
    if not np.allclose(found, 0.5, atol=1e-6):
        raise ValueError(f"a tiny problem was solved wrongly, {found} for 0.5: pip install --force-reinstall casadi")
    return f"solved a tiny problem in {solver.stats()['iter_count']} iterations"


def _linear_solvers() -> str:
    found = [name for name in LINEAR_SOLVERS if ca.has_linsol(name)]
    if not found:
        raise _Missing("casadi has none of its own; ipopt uses that which it was built with")
    return ", ".join(found)


def _processor() -> str:
    target = processor()
    features = ", ".join(target.features) or "no features beyond the default"
    lanes = f"{target.vector_bytes * 8} bits: {target.lanes(False)} rollouts at once"
    return f"{target.architecture}, {lanes}; {processors()} threads; {features}"


def _cache() -> str:
    cache = default_cache()
    folder = cache.folder
    try:
        cache.make()
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        why = f"{folder} cannot be used ({error.strerror})"
        raise OSError(f"{why}: kernels are compiled anew each time; set SYMPHYS_CACHE to another folder") from error
    return f"{folder}, writable"


def _compiler() -> str:
    try:
        found = find_compiler()
    except KernelUnavailable as error:
        raise _Missing(f"{error}; {WITHOUT}") from error
    return f"{' '.join(found.command)}: {found.version}"


def _kernels() -> Iterator[Capability]:
    """Try a tiny kernel: compiled into an empty cache, its values, its gradient, two threads, loaded from the cache."""
    with tempfile.TemporaryDirectory(prefix="symphys-doctor-", ignore_cleanup_errors=True) as folder:
        cache, program, built = Cache(Path(folder)), pendulum(), list[ProcessorKernel]()
        yield _tried("kernel, compiled", lambda: _cold(program, cache, built))
        if built:
            (kernel,) = built
            yield _tried("kernel, values", lambda: _values(kernel), required=True)
            yield _tried("kernel, gradient", lambda: _gradient(kernel), required=True)
            yield _tried("kernel, 2 threads", lambda: _threads(kernel), required=True)
            yield _tried("kernel, kept", lambda: _warm(program, cache))


def pendulum() -> Program:
    """Return the program of a damped pendulum: z is its first angle [rad] and rate [rad/s], the output a cost."""
    x = ca.SX.sym("x", 2)
    move = ca.Function("move", [x], [ca.vertcat(x[0] + DT * x[1], x[1] - DT * (9.81 * ca.sin(x[0]) + 0.1 * x[1]))])
    cost = ca.Function("cost", [x], [ca.sumsqr(x) + ca.fmax(x[1], 0)])
    at = MemoryLayout()
    state, total = at.series(2, STEPS + 1), at.take(1)
    body = (FunctionCall(move, (state,), (state.later(),)), FunctionCall(cost, (state,), (total,), accumulate=True))
    return Program(at.size, state.still(), at.take(0), STEPS, {"cost": total}, body=body, zeroed=(total,))


def _gpu() -> str:
    try:
        device = find_gpu()
        kernel = compile_on(device, pendulum())
    except KernelUnavailable as error:
        raise _Missing(f"{error}; --backend cuda is the processor then") from error
    return f"{device.name}: values are {_values(kernel)}; its gradient {_gradient(kernel)}"


def _cold(program: Program, cache: Cache, built: list[ProcessorKernel]) -> str:
    try:
        kernel = compile_program(program, cache=cache, threads=1)
    except KernelUnavailable as error:
        raise KernelUnavailable(f"{error}; {WITHOUT}") from error
    built.append(kernel)
    return f"a tiny one in {kernel.report.seconds:.2f} s, {kernel.report.lanes} lanes"


def _values(kernel: Kernel) -> str:
    mine, casadi = kernel.forward(Z)["cost"][0, 0], interpret(kernel.program, Z)["cost"][0]
    _require(mine, casadi, CLOSE)
    return "those of casadi" + (", to the bit" if mine == casadi else "")


def _gradient(kernel: Kernel) -> str:
    step = 1e-5 * np.eye(2)
    ahead, behind = ([interpret(kernel.program, Z + row)["cost"][0] for row in sign * step] for sign in (1, -1))
    _require(kernel.gradient(Z, [1.0])[1][0], (np.array(ahead) - np.array(behind)) / 2e-5, 1e-6)
    return "agrees with differences"


def _threads(kernel: ProcessorKernel) -> str:
    rows = np.array(Z) + np.linspace(0, 1, ROWS)[:, None]
    alone = kernel.gradient(rows, [1.0])[1]
    kernel.threads = 2
    _require(kernel.gradient(rows, [1.0])[1], alone, 0.0)
    return "same result as one thread"


def _warm(program: Program, cache: Cache) -> str:
    report = compile_program(program, cache=cache).report
    if not report.cached:
        raise ValueError(report.note or "it was compiled again: the cache did not keep it")
    return f"loaded from a cache in {report.seconds:.2f} s"


def _require(found: Any, wanted: Any, tolerance: float) -> None:
    """Raise ValueError for numbers that differ, which is the compiler's fault."""
    if not np.allclose(found, wanted, rtol=tolerance, atol=0):
        raise ValueError(f"{found} for {wanted}: this compiler cannot be trusted; set CC to another")
