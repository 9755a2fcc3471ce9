"""Comparison of the first gradients in single precision with those in double precision.

Rounding grows along a motion as any change does. Gradients of a robot's 200 steps in single precision were off by 60 %
of their norm in the median, and by 96 times at worst, where those of a thrown ball are right to five digits. Which it
is depends on the motion, so the first rows that a solve asks for are computed in double precision too. That needs no
compiler run: the functions of a large program go through an interpreter.

Of a single time step, the gradients of that step are compared. What rounding becomes over a chain of steps is not seen
there.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symphys.codegen.errors import KernelUnavailable, ProgramError
from symphys.codegen.program.program import Program
from symphys.codegen.toolchain.build import double_reference
from symphys.codegen.toolchain.warm_start import ProgramSource
from symphys.types import Array

MAX_ERROR = 0.1
"""Largest error of a gradient, as a share of its length, that is not reported."""
MAX_ROWS = 4
"""Largest number of rows that are compared: they fit into one block of the processor."""
MIN_LENGTH_SHARE = 1e-3
"""Shortest length that errors are compared with, as a share of the longest gradient: a row of nearly 0 has rounding."""
WARNING = (
    "gradients in single precision are off by {error} of their length here: use the backend simd or cuda, or a solver "
    "without gradients"
)
UNCHECKED = "gradients in single precision were not compared with double precision: {why}"


class PrecisionCheck:
    """Compares gradients of a program in single precision with those in double precision."""

    def __init__(self, program: Program | ProgramSource, seeded: tuple[str, ...]) -> None:
        """Compare at the first gradient; ``seeded``: outputs that are differentiated."""
        self._program, self._seeded = program, seeded

    def __call__(self, gradient: Array, arguments: tuple[Any, ...]) -> str:
        """Return a warning if gradients (batch, n) are off by over ``MAX_ERROR``, or could not be compared; else empty.

        ``arguments``: those of ``Kernel.gradient``, by which they were computed.
        """
        rows = min(MAX_ROWS, len(gradient))
        Z, seed, parameters, discount, skipped = arguments
        program = self._program.make() if isinstance(self._program, ProgramSource) else self._program
        try:
            kernel = double_reference(program, self._seeded)
            Z, seed, parameters = (first_rows(each, rows) for each in (Z, seed, parameters))
            _, exact = kernel.gradient(Z, seed, parameters, discount, skipped)
        except (KernelUnavailable, ProgramError) as refused:
            return UNCHECKED.format(why=refused)
        error = largest_error(gradient[:rows], exact)
        return WARNING.format(error=in_words(error)) if error > MAX_ERROR else ""


def warn(subject: str, doubt: str) -> None:
    """Give a RuntimeWarning, at the line that called the method that calls this, if there is a doubt.

    Args:
        subject: the name of the problem.
        doubt: of a kernel's gradients, or empty.
    """
    if doubt:
        warnings.warn(f"{subject}: {doubt}", RuntimeWarning, stacklevel=3)


def first_rows(values: ArrayLike, rows: int) -> Array:
    """Return the first rows of (batch, n), or one (n,) for all."""
    array = np.asarray(values, float)
    return array[:rows] if array.ndim == 2 else array


def largest_error(found: Array, exact: Array) -> float:
    """Return largest error of gradients (rows, n) by their lengths, of finite rows of ``exact``.

    Inf if ``found`` is not.
    """
    known = np.isfinite(exact).all(axis=1)
    if not known.any():
        return 0.0
    found, exact = found[known], exact[known]
    if not np.isfinite(found).all():
        return float("inf")
    lengths = np.linalg.norm(exact, axis=1)
    least = np.maximum(lengths, MIN_LENGTH_SHARE * lengths.max())
    off = np.linalg.norm(found - exact, axis=1)
    return float(np.max(np.where(least > 0, off / np.where(least > 0, least, 1.0), 0.0), initial=0.0))


def in_words(error: float) -> str:
    """Return a relative error in words: ``60 %``, ``96 times``."""
    if not np.isfinite(error):
        return "any multiple"
    return f"{100 * error:.0f} %" if error < 2 else f"{error:.0f} times"
