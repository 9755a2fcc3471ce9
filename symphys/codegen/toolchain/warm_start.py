"""Start of a kernel that was built before, without building its program again.

Beside each kernel lies its plan, under a checksum of all that the program is made from: the problem's data, the sources
of this package and the versions of what it builds with. Where that is not known (a Python function in the problem) the
program is built.
"""

from __future__ import annotations

import contextlib
import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import casadi as ca

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.program.program import Program
from symphys.codegen.runtime.kernel import ProcessorKernel
from symphys.codegen.toolchain.build import BlockWidth, KeptLibraries, compiled, kernel_of, width_of
from symphys.codegen.toolchain.cache import PLAN_SUFFIX, Cache, default_cache
from symphys.codegen.toolchain.identity import identity_of, package_stamp
from symphys.codegen.toolchain.kept_data import data_of, text_of
from symphys.codegen.toolchain.libraries import temporary_folder
from symphys.codegen.toolchain.plans import KeptPlan
from symphys.latest import Latest
from symphys.records import dataclass

Precision = Literal["double", "single"]
MIN_KEPT_INSTRUCTIONS = 50
"""Instructions of a function of casadi from which it is kept: fewer are built as soon as read."""
LATEST = Latest[Any](16)
"""What ``from_cache`` has returned last: problems of a sweep ask for the same."""


@dataclass(frozen=True)
class ProgramSource:
    """A program that need not be made where its kernel and its plan are kept.

    Attributes:
        make: makes it.
        identity: equal for equal programs, whichever process makes them; None: not known.
    """

    make: Callable[[], Program]
    identity: str | None = None

    def key(self, *how: object) -> str | None:
        """Return the key of what is built of it in some way by this package; None where it has no identity."""
        found = None if self.identity is None else identity_of(self.identity, package_stamp(), *how)
        return None if found is None else found[:32]


def compile_source(
    source: ProgramSource,
    seeded: Sequence[str],
    threads: int | None = None,
    precision: Precision = "double",
    cache: Cache | None = None,
    wait: bool = True,
) -> ProcessorKernel:
    """Build or find the kernel of a source; those of ``seeded`` that the program has can be differentiated.

    See ``compile_program`` and ``build.compiled`` for the other arguments.
    """
    started, single = time.perf_counter(), precision == "single"
    cache, width = cache or default_cache(), BlockWidth(width_of("auto", single), single)
    key = source.key(width.lanes, precision, tuple(seeded))
    if key is not None and (kept := found(key, lambda path: KeptPlan.read(path, source.make), cache)) is not None:
        libraries = KeptLibraries(kept, width, cache)
        if (loaded := libraries.find(width.lanes)) is not None:
            return kernel_of((width.lanes, loaded), libraries, threads, started)
    program = source.make()
    names = tuple(name for name in seeded if name in program.outputs)
    kernel, plan = compiled(program, names, width, cache, threads, wait=wait)
    if key is not None:
        keep(key, plan.write, cache)
    return kernel


Kept = TypeVar("Kept")


def found(key: str, read: Callable[[Path], Kept], cache: Cache) -> Kept | None:
    """Return what is kept under a key, by what reads its file; None if there is nothing."""
    path = replace(cache, suffix=PLAN_SUFFIX).find(key)
    if path is None:
        return None
    try:
        return read(path)
    except (OSError, ValueError, KeyError):  # taken away meanwhile
        return None


def keep(key: str, write: Callable[[Path], None], cache: Cache) -> None:
    """Store the file that ``write`` writes, if that is possible."""
    with contextlib.suppress(OSError), temporary_folder("symphys-plan-") as folder:
        path = Path(folder) / "plan.npz"
        write(path)
        replace(cache, suffix=PLAN_SUFFIX).store(key, path)


def kept_function(
    make: Callable[[], ca.Function], identity: str | None, least: int = MIN_KEPT_INSTRUCTIONS
) -> ca.Function:
    """Return a function of casadi, from the cache where one of this identity was made before; see ``from_cache``.

    It is kept from ``least`` instructions on.
    """
    return from_cache(make, identity, worth=lambda function: function.n_instructions() >= least)


def from_cache(
    make: Callable[[], Kept],
    identity: str | None,
    kinds: Sequence[type] = (),
    worth: Callable[[Kept], bool] = lambda _: True,
) -> Kept:
    """Return what ``make`` makes, from the cache where something of this identity was made before.

    Args:
        make: makes data, see ``text_of``.
        identity: as in ``ProgramSource``.
        kinds: the named tuples and data classes in it.
        worth: whether it is kept.
    """
    key = None if identity is None else identity_of(identity, package_stamp())[:32]  # type: ignore[index]
    if key is None:
        return make()
    if (known := LATEST.get(key)) is not None:
        return known[0]  # type: ignore[no-any-return]
    try:
        cache = default_cache()
    except KernelUnavailable:
        return make()
    if (known := found(key, lambda path: _read(path, kinds), cache)) is None:
        known = [make()]
        if worth(known[0]):
            keep(key, lambda path: _write(known, path), cache)
    return LATEST.put(key, known)[0]  # type: ignore[no-any-return]


def _write(made: object, path: Path) -> None:
    path.write_bytes(zlib.compress(text_of(made).encode(), 1))


def _read(path: Path, kinds: Sequence[type]) -> Any:
    try:
        return data_of(zlib.decompress(path.read_bytes()).decode(), kinds)
    except zlib.error as error:
        raise ValueError(f"{path} holds nothing that can be read") from error
