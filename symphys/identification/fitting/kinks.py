"""Steps at a kink of the merit, from the Jacobians on both sides.

An impact that falls on a sample gives the merit a kink: one side has the velocity before the impact, the other that
after it. The Jacobian of one side then promises a fall across the kink that is not there. A bundle method (Lemaréchal
1978; Kiwiel 1985) collects the Jacobians of points where a step was refused. The cost of recording k about a point x is

    f_k(x + d) = f_k(x) + max_p (2 g_kp d - e_kp) + d H_k d,

with p the sides, g_kp half the gradient that side p has at x, and e_kp how far its cost is from f_k(x) there. The dual
of the step is a quadratic program in the shares of the sides, one simplex for each recording. Where it promises no
fall, no direction lowers the merit: the point is a minimum at the kink (Clarke 1983). Sides that do not fit together
have a large e_kp, so that a wrong Jacobian or a cliff does not pass for a kink.
"""

from __future__ import annotations

import numpy as np
import scipy.optimize

from symphys.identification.fitting.arrow import ArrowSystem
from symphys.identification.fitting.remaining import DeterminedArrow
from symphys.types import Array, Bools, Ints

MAX_WEIGHTED_SIDES = 200
"""Largest number of sides of single recordings in a step; the most different ones are taken."""
SUM_WEIGHT = 1e4
"""Weight of the equations that make the shares of a recording sum to 1."""
RELATIVE_RIDGE = 1e-12
"""Share of its largest diagonal that is added to the quadratic program."""


class KinkedModel:
    """The model of the merit about a point with the known sides.

    Attributes:
        system: the arrow at the point.
        gradients: (P, K, n) of the sides at the point, in scales; the first is the arrow's own.
        gaps: (P, K) how far the costs of the sides are from those at the point.
        unit: the merit per residual: the fall of a standard error.
    """

    def __init__(self, system: ArrowSystem, unit: float) -> None:
        """Start with the side of the arrow."""
        self.system, self.unit = system, unit
        self.gradients, self.gaps = system.gradients[None], np.zeros((1, len(system.costs)))

    @property
    def sides(self) -> int:
        """Return the number of known sides."""
        return len(self.gaps)

    def add(self, there: ArrowSystem, shared: Array, own: Array) -> None:
        """Add the side of a point at the step (s,), (K, o)."""
        step = np.concatenate([np.broadcast_to(shared, (len(own), len(shared))), own], axis=1)
        bent = np.einsum("kij,kj->ki", there.blocks, step)
        costs = there.costs - 2 * np.sum(there.gradients * step, axis=1) + np.sum(bent * step, axis=1)
        self.gradients = np.concatenate([self.gradients, (there.gradients - bent)[None]])
        self.gaps = np.concatenate([self.gaps, np.abs(self.system.costs - costs)[None]])

    def expected_fall(self, shared: Array, own: Array) -> float:
        """Return the decrease of the merit predicted for a step (s,), (K, o)."""
        step = np.concatenate([np.broadcast_to(shared, (len(own), len(shared))), own], axis=1)
        more = 2 * np.sum((self.gradients - self.gradients[0]) * step, axis=2) - self.gaps
        return self.system.expected_fall(shared, own) - float(np.sum(np.max(more, axis=0)))

    def step(self, arrow: DeterminedArrow) -> tuple[Array, Array, float]:
        """Compute the step (s,), (K, o) in scales, and the predicted decrease."""
        s, base = self.system.s, self.system.gradients
        taken, sides = self._taken(arrow)
        prior = self.system.prior_gradient * arrow.units[0, :s]
        scaled = self.gradients[..., s:] * arrow.units[:, s:]
        combined, gap = base.copy(), 0.0
        if len(taken):
            shares = self._shares(arrow, taken, sides, scaled, prior)
            k, p = taken.T
            for recording in np.unique(k):
                mine = k == recording
                combined[recording] = np.einsum("p,pn->n", shares[mine], self.gradients[p[mine], recording])
            gap = float(shares @ self.gaps[p, k])
        side = arrow.sides(combined).sum(axis=0) + prior
        own = combined[:, s:] * arrow.units[:, s:]
        fall = float(side @ arrow.shared_inverse @ side) + float(np.einsum("ka,kab,kb->", own, arrow.own_inverse, own))
        return *arrow.step(combined), fall + gap

    def _taken(self, arrow: DeterminedArrow) -> tuple[Ints, Array]:
        """Return (N, 2) recordings and sides in the step, and (P, K, s) the right sides of all."""
        s, sides = self.system.s, arrow.sides(self.gradients)
        off, own = sides - sides[0], (self.gradients - self.gradients[0])[..., s:] * arrow.units[:, s:]
        apart = np.einsum("pks,st,pkt->pk", off, arrow.shared_inverse, off)
        apart += np.einsum("pka,kab,pkb->pk", own, arrow.own_inverse, own)
        least = max(np.sort(apart, axis=None)[-min(MAX_WEIGHTED_SIDES, apart.size)], 1e-12 * self.unit)
        chosen: Bools = (apart >= least) & (apart > 0)
        chosen[0] = chosen.any(axis=0)
        p, k = np.nonzero(chosen)
        return np.stack([k, p], axis=1), sides

    def _shares(self, arrow: DeterminedArrow, taken: Ints, sides: Array, own: Array, prior: Array) -> Array:
        """Return (N,) shares of the sides ``taken``, at least 0, that sum to 1 for each recording."""
        k, p = taken.T
        mine, same = sides[p, k], k[:, None] == k
        alone = np.setdiff1d(np.arange(len(self.system.costs)), k)
        rest = prior + sides[0, alone].sum(axis=0)
        gained = np.einsum("iab,ib->ia", arrow.own_inverse[k], own[p, k])
        square = (mine @ arrow.shared_inverse @ mine.T + same * (own[p, k] @ gained.T)) / self.unit
        linear = (2 * mine @ arrow.shared_inverse @ rest + self.gaps[p, k]) / self.unit
        values, vectors = np.linalg.eigh(square)
        root = np.sqrt(np.maximum(values, 0) + RELATIVE_RIDGE * max(values[-1], 1e-300))
        weight = SUM_WEIGHT * root[-1]
        together = (np.unique(k)[:, None] == k) * weight
        rows = np.concatenate([root[:, None] * vectors.T, together])
        right = np.concatenate([-(vectors.T @ linear) / (2 * root), np.full(len(together), weight)])
        shares, _ = scipy.optimize.nnls(rows, right)
        sums = np.bincount(k, shares)[k]
        return np.asarray(np.where(sums > 0, shares / np.where(sums > 0, sums, 1.0), (p == 0).astype(float)))
