"""Whether a given inertia is that of any real body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

ROUNDING = 1e-9
"""Relative slack for symmetry and the triangle inequality, which flat and thin bodies meet with equality."""


def inertia_fault(value: float | Sequence[float] | Sequence[Sequence[float]]) -> str:
    """Why no rigid body has this inertia; empty if one has."""
    given = np.asarray(value, float)
    if given.ndim == 2 and not np.allclose(given, given.T, rtol=ROUNDING, atol=ROUNDING * np.abs(given).max()):
        return "the matrix must be symmetric"
    moments = np.sort(np.linalg.eigvalsh(given) if given.ndim == 2 else np.broadcast_to(given, 3))
    listed = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] <= 0:
        return f"the principal moments must be positive; they are {listed}"
    if moments[0] + moments[1] < moments[2] * (1 - ROUNDING):
        return f"no principal moment may exceed the sum of the other two; they are {listed}"
    return ""
