"""One thread for linear algebra: the matrices are small, and results must not depend on how many runs go at once."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
PACKAGES = ("numpy", "scipy")
"""Whose wheels bring OpenBLAS along."""
NAMES = tuple(f"{prefix}openblas_{{}}_num_threads{suffix}" for prefix in ("scipy_", "") for suffix in ("64_", ""))
"""Under which builds of OpenBLAS export how many threads they take."""


def limit() -> None:
    """Ask for one thread, unless the environment says otherwise.

    Works for libraries that are loaded later, here and in processes started from here.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, "1")


@contextmanager
def limited() -> Iterator[None]:
    """One thread for OpenBLAS, loaded or not, unless the environment says otherwise; as before at the end."""
    asked = any(name in os.environ for name in VARIABLES[:2])
    before = [] if asked else [(each, each.get()) for each in libraries()]
    try:
        for each, _ in before:
            each.set(1)
        yield
    finally:
        for each, count in before:
            each.set(count)


class OpenBlas(NamedTuple):
    """A library: how many threads it takes."""

    get: Callable[[], int]
    set: Callable[[int], None]


def libraries() -> list[OpenBlas]:
    """Load the OpenBLAS libraries that the packages bring along, before the packages themselves are imported."""
    found = []
    for name in PACKAGES:
        found_in = find_spec(name)
        if found_in is not None and found_in.origin is not None:
            package = Path(found_in.origin).parent
            folders = package.parent / f"{name}.libs", package / ".dylibs"
            paths = sorted(path for folder in folders for path in folder.glob("*openblas*"))
            found += [each for each in map(_opened, paths) if each is not None]
    return found


def _opened(path: Path) -> OpenBlas | None:
    """The library; None where it cannot be loaded, or has other names."""
    try:
        library = ctypes.CDLL(str(path))
    except OSError:
        return None
    for name in NAMES:
        if hasattr(library, name.format("set")) and hasattr(library, name.format("get")):
            put = getattr(library, name.format("set"))
            put.argtypes, put.restype = (ctypes.c_int,), None
            return OpenBlas(getattr(library, name.format("get")), put)
    return None
