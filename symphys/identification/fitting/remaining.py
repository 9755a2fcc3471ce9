"""What is left of a fit in the directions that its recordings determine.

A direction whose standard error is ``VAGUE`` times the size of its numbers is vague: the quadratic model puts its
minimum where that model no longer holds. An example is the spin of a ball that slides through every impact: residuals
depend on it by little more than rounding, and noise puts its minimum thousands of rad/s away. A vague direction has no
part in whether a fit has converged, and steps along it bring nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.identification.fitting.arrow import ArrowSystem
from symphys.identification.interface import Array, Bools, FitParameters, Ints

VAGUE = 10.0
"""Standard error of a direction by the size of its numbers, above which it is vague."""
PART = 0.5
"""A number takes part in a direction if its component is larger, in units of the numbers."""


class DeterminedArrow:
    """An arrow of K recordings in units of the numbers' sizes, without what is vague.

    Attributes:
        system: the arrow in scaled numbers.
        units: (K, n) sizes of shared and own numbers, in scales; 0 for what a bound holds.
        own_inverse: (K, o, o) of the own blocks.
        gain: (K, o, s) how own numbers follow the shared ones.
        shared_inverse: (s, s) of the Schur complement.
        vague_shared, vague_own: (s,) and (K, o) numbers that take part in a vague direction.
    """

    def __init__(self, system: ArrowSystem, units: Array, damping: float = 0.0) -> None:
        """``damping`` is added to the squares, as in a step of Levenberg-Marquardt."""
        s = system.s
        self.system, self.units = system, units
        blocks = system.blocks * units[:, :, None] * units[:, None, :]
        self.own_inverse, vague_own = determined_inverse(blocks[:, s:, s:], damping)
        coupling = blocks[:, :s, s:]
        self.gain = -self.own_inverse @ coupling.transpose(0, 2, 1)
        shared = units[0, :s]
        prior = np.diag(system.prior_block * shared**2)
        whole = blocks[:, :s, :s].sum(axis=0) + prior + np.einsum("ksa,kat->st", coupling, self.gain)
        self.shared_inverse, vague_shared = determined_inverse(whole, damping)
        self.vague_shared, self.vague_own = vague_shared & (shared > 0), vague_own & (units[:, s:] > 0)

    @property
    def whole(self) -> bool:
        """Whether no direction is vague."""
        return not (self.vague_shared.any() or self.vague_own.any())

    def sides(self, gradients: Array) -> Array:
        """(..., s) the right side of the shared numbers, of gradients (..., K, n) in scales, recording by recording."""
        s = self.system.s
        scaled = gradients * self.units
        return np.asarray(scaled[..., :s] + np.einsum("kas,...ka->...ks", self.gain, scaled[..., s:]))

    def step(self, gradients: Array | None = None) -> tuple[Array, Array]:
        """(s,) and (K, o), in scales: where the gradients (K, n), by default the arrow's, lead."""
        s = self.system.s
        gradients = self.system.gradients if gradients is None else gradients
        side = self.sides(gradients).sum(axis=0) + self.system.prior_gradient * self.units[0, :s]
        shared = -self.shared_inverse @ side
        own = self.gain @ shared - np.einsum("kab,kb->ka", self.own_inverse, gradients[:, s:] * self.units[:, s:])
        return shared * self.units[0, :s], own * self.units[:, s:]


def determined_inverse(square: Array, damping: float) -> tuple[Array, Bools]:
    """Inverses of damped symmetric (..., n, n) without what is vague, and (..., n) which numbers that concerns."""
    values, vectors = np.linalg.eigh(square)
    vague = values < 1 / VAGUE**2
    inverse = np.where(vague, 0.0, 1 / (np.where(vague, 1.0, values) + damping))
    found = (vectors * inverse[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return found, np.any((np.abs(vectors) > PART) & vague[..., None, :], axis=-1)


def number_units(
    parameters: Sequence[FitParameters], values: Sequence[Array], free: Sequence[Bools], which: Ints
) -> Array:
    """(k, n): sizes of the free shared and own numbers in scales, their own size where that is larger, else 0."""
    (shared_of, own_of), (shared, own) = parameters, values
    shared_units = np.maximum(np.abs(shared) / shared_of.scale, 1.0) * free[0]
    own_units = np.maximum(np.abs(own) / own_of.scale, 1.0)[which] * free[1]
    return np.concatenate([np.broadcast_to(shared_units, (len(which), len(shared))), own_units], axis=1)
