"""Least squares by square roots: singular values of rows instead of eigenvalues of their squares.

J'J has the square of the condition of J, and squares lose half of the digits: a J of condition 1e8 leaves a J'J that is
singular to rounding. Everything here works on rows F with F'F = J' C J, whose singular values are right to rounding of
the largest, after columns were scaled to length 1. What counts as no information is what rounding makes: a singular
value below that of the derivatives (``derivative_noise``), never a small one (Golub and Van Loan, Matrix Computations,
sections 5.5 and 5.6).
"""

from __future__ import annotations

import numpy as np

from symphys.records import dataclass
from symphys.types import Array, Bools

EPS = float(np.finfo(float).eps)
ROUNDING = 1e-13
"""Singular values of columns of length 1, relative to the largest, that always count as rounding."""
NO_EFFECT = 1e-14
"""Relative length below which a column, in scaled numbers, counts as rounding."""
NOISE_FACTOR = 5.0
"""Factor on the measured noise of the derivatives below which singular values are rounding."""
MIN_TOUCHED_COMPONENT = 1e-3
"""Least component with which a number takes part in a direction without information."""


def triangle(rows: Array) -> Array:
    """Compute (n, n) R with R'R = F'F of rows F (m, n)."""
    n = rows.shape[1]
    found = np.zeros((n, n))
    if n and len(rows):
        r = np.linalg.qr(rows, mode="r")
        found[: len(r)] = r
    return found


@dataclass(frozen=True, eq=False)
class Root:
    """The pseudo-inverse P of rows F (..., m, n), so that P P' = (F'F)^-1 in directions with information.

    Attributes:
        inverse: (..., n, m) P.
        whitener: (..., n, n) W with W W' = P P': along its columns the information is 1, or none where one is zero.
        range: (..., m, r) orthonormal columns that span what the columns of F do, zero where there is no information.
        touched: (..., n) numbers that take part in a direction without information.
        weakest: (...,) the smallest singular value that is kept, of columns of length 1, and not more than the ratio
            of the shortest column to the longest; 1 without columns.
    """

    inverse: Array
    whitener: Array
    range: Array
    touched: Bools
    weakest: Array

    @property
    def square(self) -> Array:
        """Return (..., n, n) the inverse of F'F."""
        return np.asarray(self.whitener @ np.swapaxes(self.whitener, -1, -2))


def pseudo_root(rows: Array, noise: Array | float = 0.0) -> Root:
    """Compute the pseudo-inverse of rows.

    Args:
        rows: (..., m, n).
        noise: (..., n) lengths of what rounding adds to the columns.
    """
    # Columns at length 1; those that are rounding become zero.
    lengths = np.linalg.norm(rows, axis=-2)
    longest = np.max(lengths, axis=-1, initial=0.0, keepdims=True)
    rounding = lengths <= np.maximum(NO_EFFECT * longest, NOISE_FACTOR * np.asarray(noise))
    unit = np.where(rounding, 1.0, lengths)
    scaled = np.where(rounding[..., None, :], 0.0, rows / unit[..., None, :])
    # Singular values at the level of rounding or of the noise of the derivatives carry no information.
    left, sizes, right = np.linalg.svd(scaled, full_matrices=False)
    vectors = np.swapaxes(right, -1, -2)
    along = np.sqrt(np.einsum("...ji,...j->...i", vectors**2, (np.where(rounding, 0.0, noise) / unit) ** 2))
    largest = np.max(sizes, axis=-1, initial=0.0, keepdims=True)
    none = sizes <= np.maximum(ROUNDING * largest, NOISE_FACTOR * along)
    # Pseudo-inverse without these directions, and the numbers that take part in them.
    share = np.where(none, 0.0, 1 / np.where(none, 1.0, sizes))
    whitener = vectors * share[..., None, :] / unit[..., :, None]
    inverse = whitener @ np.swapaxes(left, -1, -2)
    touched = rounding | np.any((np.abs(vectors) > MIN_TOUCHED_COMPONENT) & none[..., None, :], axis=-1)
    shortest = np.min(np.where(rounding, np.inf, lengths), axis=-1, initial=np.inf) / np.maximum(longest[..., 0], EPS)
    weakest = np.minimum(np.min(np.where(none, np.inf, sizes), axis=-1, initial=1.0), shortest)
    return Root(inverse, whitener, left * ~none[..., None, :], touched, weakest)


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Rows of K recordings with the own numbers eliminated.

    Attributes:
        own: the pseudo-inverses of the own columns.
        gain: (K, o, s) how own numbers follow the shared ones.
        left: (K, m, s) what is left of the shared columns; the Schur complement is the sum of left' left.
    """

    own: Root
    gain: Array
    left: Array


def stacked(rows: Array) -> Array:
    """Stack rows (K, m, s) to (K m, s)."""
    return rows.reshape(rows.shape[0] * rows.shape[1], rows.shape[2])


def eliminate(rows: Array, s: int, noise: Array | float = 0.0) -> Eliminated:
    """Eliminate the last columns of rows (K, m, n), all but ``s``; ``noise`` (K, o): see ``pseudo_root``."""
    shared, root = rows[:, :, :s], pseudo_root(rows[:, :, s:], noise)
    left = shared - root.range @ (np.swapaxes(root.range, -1, -2) @ shared)
    return Eliminated(root, -root.inverse @ shared, left)
