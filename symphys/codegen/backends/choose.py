"""The backend that is asked for, or the best that this machine has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from symphys.codegen import KernelUnavailable, ProgramError, processors
from symphys.codegen.backends.casadi_ import casadi
from symphys.codegen.backends.interface import Backend, BackendSource
from symphys.codegen.backends.kernels import PRECISIONS
from symphys.codegen.backends.simd import by_kernel
from symphys.errors import SymphysError


def c(source: BackendSource, threads: int) -> Backend:
    """Make the backend of ``c_``, imported late."""
    from symphys.codegen.backends import c_

    return c_.c(source, threads)


BACKENDS: dict[str, Callable[[BackendSource, int], Backend]] = {
    **{name: partial(by_kernel, name=name) for name in PRECISIONS},
    "c": c,
    "casadi": casadi,
}
NAMES = tuple(BACKENDS)
INTERPRETED = "casadi's virtual machine evaluates, which is slower"


def require_backend(name: str, valid: Sequence[str] = NAMES) -> None:
    """Raise a SymphysError that names the valid backends, unless this is one."""
    if name not in valid:
        raise SymphysError(f"there is no backend {name!r}; valid: {', '.join(valid)}")


def choose(name: str, source: BackendSource, threads: int | None = None) -> Backend:
    """Return the backend of this name for a problem; casadi where that cannot be built, with a note that says why.

    Args:
        name: one of NAMES; "auto" is the fastest: simd, and cuda for large batches where there is a GPU.
        source: the problem.
        threads: that share a batch; None: one for each processor.
    """
    count = processors() if threads is None else threads
    try:
        return BACKENDS[name](source, count)
    except (KernelUnavailable, ProgramError) as error:
        note = f"{INTERPRETED}: {error}"
        backend = casadi(source, count)
        return replace(backend, description=replace(backend.description, note=note))
