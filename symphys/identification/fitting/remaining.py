"""The distance to the minimum in the directions that the recordings determine.

A direction whose standard error is ``VAGUE_ERROR`` times the size of its numbers is vague: the quadratic model puts its
minimum where that model no longer holds. An example is the spin of a ball that slides through every impact: residuals
depend on it by little more than rounding, and noise puts its minimum thousands of rad/s away. A vague direction has no
part in whether a fit has converged, and steps along it bring nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from symphys.identification.fitting.arrow import ArrowSystem
from symphys.identification.fitting.square_root import stacked, triangle
from symphys.identification.interface import FitParameters
from symphys.types import Array, Bools, Ints

VAGUE_ERROR = 10.0
"""Standard error of a direction, relative to its numbers, above which it is not determined."""
MIN_COMPONENT = 0.5
"""Least component, in units of the numbers, with which a number takes part in a direction."""


class DeterminedArrow:
    """An arrow of K recordings in units of the numbers' sizes, in determined directions only.

    Attributes:
        system: the arrow in scaled numbers.
        units: (K, n) sizes of shared and own numbers, in scales; 0 for what a bound holds.
        own_inverse: (K, o, o) of the own blocks.
        gain: (K, o, s) how own numbers follow the shared ones.
        shared_inverse: (s, s) of the Schur complement.
        vague_shared, vague_own: (s,) and (K, o) numbers that take part in a vague direction.
    """

    def __init__(self, system: ArrowSystem, units: Array, damping: float = 0.0) -> None:
        """Invert the blocks, with ``damping`` added to the squares, as in a step of Levenberg-Marquardt."""
        s = system.s
        self.system, self.units = system, units
        rows, shared = system.roots * units[:, None, :], units[0, :s]
        own, vague_own = determined_root(rows[:, :, s:], damping)
        self.own_inverse = own @ own.transpose(0, 2, 1)
        below = np.zeros((len(rows), own.shape[1], rows.shape[2]))
        below[:, :, s:] = math.sqrt(damping) * np.eye(own.shape[1])
        damped = np.concatenate([rows, below], axis=1)
        self.gain = -own @ damped[:, :, :s]
        left = damped[:, :, :s] + damped[:, :, s:] @ self.gain
        whole = np.concatenate([stacked(left), np.diag(np.sqrt(system.prior_block) * shared)])
        root, vague_shared = determined_root(triangle(whole), damping)
        self.shared_inverse = root @ root.T
        self.vague_shared, self.vague_own = vague_shared & (shared > 0), vague_own & (units[:, s:] > 0)

    @property
    def whole(self) -> bool:
        """Whether every direction is determined."""
        return not (self.vague_shared.any() or self.vague_own.any())

    def sides(self, gradients: Array) -> Array:
        """Return (..., s) the right side of the shared numbers, by recording, of gradients (..., K, n) in scales."""
        s = self.system.s
        scaled = gradients * self.units
        return np.asarray(scaled[..., :s] + np.einsum("kas,...ka->...ks", self.gain, scaled[..., s:]))

    def step(self, gradients: Array | None = None) -> tuple[Array, Array]:
        """Compute the step (s,), (K, o), in scales, for gradients (K, n), by default the arrow's."""
        s = self.system.s
        gradients = self.system.gradients if gradients is None else gradients
        side = self.sides(gradients).sum(axis=0) + self.system.prior_gradient * self.units[0, :s]
        shared = -self.shared_inverse @ side
        own = self.gain @ shared - np.einsum("kab,kb->ka", self.own_inverse, gradients[:, s:] * self.units[:, s:])
        return shared * self.units[0, :s], own * self.units[:, s:]


def determined_root(rows: Array, damping: float) -> tuple[Array, Bools]:
    """Return pseudo-inverses (..., n, m + n) of damped rows (..., m, n) in the determined directions.

    Also (..., n) which numbers take part in what is vague.
    """
    left, sizes, right = np.linalg.svd(rows, full_matrices=False)
    vectors = np.swapaxes(right, -1, -2)
    vague = sizes < 1 / VAGUE_ERROR
    inverse = np.where(vague, 0.0, 1 / (np.where(vague, 1.0, sizes) ** 2 + damping))
    above = (vectors * (sizes * inverse)[..., None, :]) @ np.swapaxes(left, -1, -2)
    below = (vectors * (math.sqrt(damping) * inverse)[..., None, :]) @ right
    found = np.concatenate([above, below], axis=-1)
    return found, np.any((np.abs(vectors) > MIN_COMPONENT) & vague[..., None, :], axis=-1)


def number_units(
    parameters: Sequence[FitParameters], values: Sequence[Array], free: Sequence[Bools], which: Ints
) -> Array:
    """Return (k, n) sizes of the free numbers in scales, their own size where that is larger; 0 of the others."""
    (shared_of, own_of), (shared, own) = parameters, values
    shared_units = np.maximum(np.abs(shared) / shared_of.scale, 1.0) * free[0]
    own_units = np.maximum(np.abs(own) / own_of.scale, 1.0)[which] * free[1]
    return np.concatenate([np.broadcast_to(shared_units, (len(which), len(shared))), own_units], axis=1)
