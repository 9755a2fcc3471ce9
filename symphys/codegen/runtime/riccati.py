"""The Riccati recursion in C, for problems so small that what numpy needs for a call outweighs what it computes."""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.libraries import own_library
from symphys.types import Array

MAX_WORK = 64**3
"""Products of matrices with so many multiplications are left to numpy, whose library is faster then."""


class CompiledRiccati:
    """Implements ``symphys.shooting.CompiledRecursion``."""

    def __init__(self, library: ctypes.CDLL) -> None:
        """Wrap the compiled ``riccati.c``."""
        self._library = library
        self._call = library.riccati
        self._call.argtypes, self._call.restype = (*[ctypes.c_int64] * 4, *[ctypes.c_void_p] * 13), ctypes.c_int

        self._costates = library.costates
        self._costates.argtypes, self._costates.restype = (*[ctypes.c_int64] * 4, *[ctypes.c_void_p] * 5), None

    def costates(self, a: Array, slopes: Array, last: Array) -> tuple[Array, Array]:
        """Implement ``CompiledRecursion``."""
        steps, n, _ = a.shape
        if a.strides[2] != a.itemsize:
            a = np.ascontiguousarray(a)
        step, row = (stride // a.itemsize for stride in a.strides[:2])
        after, first = np.empty((steps, n)), np.empty(n)
        given = a, np.ascontiguousarray(slopes), np.ascontiguousarray(last)
        self._costates(steps, n, step, row, *(each.ctypes.data for each in (*given, after, first)))
        return after, first

    def suits(self, through: Array) -> bool:
        """Whether steps of this shape (K, r, c) take less time here than by numpy."""
        return bool(through.shape[1] * through.shape[2] ** 2 <= MAX_WORK)

    def __call__(
        self,
        through: Array,
        slope: Array,
        curve: Array,
        bounds: tuple[Array, Array, Array],
        cost: tuple[Array, Array],
    ) -> tuple[Array, Array, tuple[float, float], tuple[Array, Array]] | None:
        """Implement ``CompiledRecursion``."""
        steps, after, columns = through.shape
        w = bounds[0].shape[1]
        n = columns - w
        given = [np.ascontiguousarray(each, np.float64) for each in (through, slope, curve, *bounds, *cost)]
        ahead, back, expected = np.empty((steps, w)), np.empty((steps, w, n)), np.zeros(2)
        first, second = np.empty(n), np.empty((n, n))
        arrays = (*given, ahead, back, expected, first, second)
        if not self._call(steps, after, n, w, *(each.ctypes.data for each in arrays)):
            return None
        return ahead, back, (float(expected[0]), float(expected[1])), (first, second)


@cache
def compiled_riccati() -> CompiledRiccati | None:
    """Return the compiled recursion; None without a compiler. It is built once for a machine."""
    try:
        return CompiledRiccati(own_library("riccati.c"))
    except KernelUnavailable:
        return None
