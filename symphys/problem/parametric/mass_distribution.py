"""Inertia by numbers that bounds alone keep physical: second moments of the mass, and how they are correlated.

With Sigma = integral of x x' dm about the centre of mass, the inertia is trace(Sigma) 1 - Sigma. A rigid body has this
inertia if and only if Sigma is positive semidefinite (Wensing, Kim and Slotine, IEEE RA-L 3(1), 2018), which holds the
triangle inequalities of its moments too. Sigma is given by its diagonal, which must not be negative, and by three
correlations in [-1, 1]: xy, xz, and yz for given x. These are partial correlations (Lewandowski, Kurowicka and Joe,
J. Multivariate Analysis 100(9), 2009), of which any three make a correlation matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import casadi as ca
import numpy as np

from symphys.model.scalar import Scalar, is_zero
from symphys.model.shapes.inertia import NOISE


def distribution(tensor: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Second moments (3,) [kg m^2] and correlations (3,) [-] of an inertia as ``Body`` has it, body frame."""
    given = np.asarray(tensor, float)
    whole = given if given.ndim == 2 else np.diag(np.broadcast_to(given, 3))
    sigma = np.trace(whole) / 2 * np.eye(3) - whole
    moments = np.where(np.diag(sigma) > NOISE * np.trace(whole), np.diag(sigma), 0.0)
    if not np.any(whole - np.diag(np.diag(whole))):
        return tuple(moments.tolist()), (0.0, 0.0, 0.0)
    width = np.sqrt(moments)
    xy, xz, yz = (_ratio(sigma[i, j], width[i] * width[j]) for i, j in ((0, 1), (0, 2), (1, 2)))
    return tuple(moments.tolist()), (xy, xz, _ratio(yz - xy * xz, sqrt((1 - xy * xy) * (1 - xz * xz))))


def _ratio(part: float, whole: float) -> float:
    """Of a product to its bound, in [-1, 1]; 0 where the bound leaves no room."""
    return max(-1.0, min(1.0, float(part / whole))) if whole > 0 else 0.0


def inertia(moments: Sequence[Scalar], correlations: Sequence[Scalar]) -> Any:
    """The inertia [kg m^2] as ``Body`` takes it, body frame: principal moments if nothing is correlated."""
    a, b, c = moments
    if all(is_zero(each) for each in correlations):
        return b + c, a + c, a + b
    xy, xz, rest = correlations
    yz = xy * xz + rest * ca.sqrt((1 - xy * xy) * (1 - xz * xz))
    x, y, z = (ca.sqrt(each) for each in moments)
    pxy, pxz, pyz = -xy * x * y, -xz * x * z, -yz * y * z
    return (b + c, pxy, pxz), (pxy, a + c, pyz), (pxz, pyz, a + b)
