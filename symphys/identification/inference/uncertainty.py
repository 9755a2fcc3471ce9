"""Standard errors, 95 % intervals and correlations of what was estimated, from the Jacobian at the estimate.

With H the arrow of second derivatives and M that of the squares of the scores, the covariance is H^-1 M H^-1. In least
squares M is H, and the covariance its inverse, which is the Cramer-Rao bound under normal noise. Under Huber's loss M
has psi^2 and H psi': the sandwich (Huber 1967, White 1980). Residuals are in units of the noise, whether it is given or
estimated (``noise``), so no factor is left.

The own numbers are eliminated, recording by recording. Numbers at a bound are held: their intervals are nan, and those
of the others hold under that condition. A direction without information has the standard error inf, and so has an own
number that takes part in a vague one (``remaining``): that of the Jacobian is beyond where the Jacobian holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.stats

from symphys.identification.fitting.arrow import NO_INFORMATION, ArrowSystem, assemble
from symphys.identification.fitting.levenberg_marquardt import movable
from symphys.identification.fitting.remaining import DeterminedArrow, number_units
from symphys.identification.fitting.robust_loss import RobustLoss
from symphys.identification.interface import Array, Bools, FitParameters, Ints, RecordedResiduals, Rows

LEVEL = 0.95
TOUCHED = 1e-3
"""A number takes part in a direction without information if its component is larger."""


@dataclass(frozen=True, eq=False)
class Information:
    """The arrow at an estimate with the own numbers eliminated, in scaled numbers; k recordings that were fitted.

    Attributes:
        shared: (s, s) the Schur complement S.
        reference: (s,) the diagonal before the elimination.
        shares: (k, s, s) what each recording adds to it.
        own_inverse: (k, o, o) D^-1, without the directions that have no information.
        own_open: (k, o) numbers that take part in such a direction.
        gain: (k, o, s) -D^-1 B', how the own estimates follow the shared ones.
        free_shared, free_own: (s,), (k, o) False for what a bound holds.
    """

    shared: Array
    reference: Array
    shares: Array
    own_inverse: Array
    own_open: Bools
    gain: Array
    free_shared: Bools
    free_own: Bools


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How well K recordings determine s shared and o own numbers, in their own units.

    Attributes:
        covariance: (s, s) of the shared numbers; inf on the diagonal without information, nan for what a bound holds.
        error, own_error: (s,), (K, o) standard errors; nan for recordings that were not fitted.
        correlation: (s, s), nan where it is not known.
        quantile: half the interval by the standard error.
        freedom: residuals less numbers that were estimated.
        at_bound, own_at_bound: (s,), (K, o) -1 at the lower bound, 1 at the upper, else 0.
        information: from which this was computed.
    """

    covariance: Array
    error: Array
    own_error: Array
    correlation: Array
    quantile: float
    freedom: int
    at_bound: Ints
    own_at_bound: Ints
    information: Information

    def interval(self, value: Array) -> Array:
        """(s, 2) about the shared estimates (s,)."""
        half = self.quantile * self.error
        return np.stack([value - half, value + half], axis=1)


def pseudo_inverse(matrices: Array, size: Array) -> tuple[Array, Bools]:
    """Inverses of symmetric (..., n, n) without what has no information, and (..., n) which numbers that concerns.

    ``size``: (..., n) what rounding of the diagonal is small against.
    """
    unit = np.where(size > 0, np.sqrt(size), 1.0)
    values, vectors = np.linalg.eigh(matrices / unit[..., :, None] / unit[..., None, :])
    none = values <= NO_INFORMATION * np.max(values, axis=-1, initial=0.0, keepdims=True)
    inverse = np.where(none, 0.0, 1 / np.where(none, 1.0, values))
    found = (vectors * inverse[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    touched = np.any((np.abs(vectors) > TOUCHED) & none[..., None, :], axis=-1)
    return found / unit[..., :, None] / unit[..., None, :], touched


def make_information(system: ArrowSystem, free_shared: Bools, free_own: Bools) -> Information:
    """Eliminate the own numbers from an arrow, (s,) and (k, o) of whose numbers are free."""
    s = system.s
    masked = (
        system.blocks * np.concatenate([np.broadcast_to(free_shared, (len(free_own), s)), free_own], axis=1)[:, None]
    )
    masked = masked * np.concatenate([np.broadcast_to(free_shared, (len(free_own), s)), free_own], axis=1)[:, :, None]
    inverse, touched = pseudo_inverse(masked[:, s:, s:], np.diagonal(masked[:, s:, s:], axis1=1, axis2=2))
    coupling = masked[:, :s, s:]
    gain = -inverse @ coupling.transpose(0, 2, 1)
    shares = masked[:, :s, :s] + coupling @ gain
    whole = shares.sum(axis=0) + np.diag(system.prior_block * free_shared)
    return Information(
        whole, system.reference * free_shared, shares, inverse, touched & free_own, gain, free_shared, free_own
    )


def covariances(bread: Information, meat: ArrowSystem) -> tuple[Array, Array, Bools]:
    """Scaled covariances H^-1 M H^-1: (s, s), and (k, o) variances of own numbers; (s,) shared ones left open."""
    inverse, open_shared = pseudo_inverse(bread.shared, bread.reference)
    s = len(inverse)
    scores = meat.blocks
    ahead = np.concatenate([np.broadcast_to(np.eye(s), (len(scores), s, s)), bread.gain.transpose(0, 2, 1)], axis=2)
    filling = np.einsum("kai,kij,kbj->ab", ahead, scores, ahead) + np.diag(meat.prior_block)
    shared = inverse @ filling @ inverse
    moved = bread.gain @ shared @ bread.gain.transpose(0, 2, 1)
    alone = bread.own_inverse @ scores[:, s:, s:] @ bread.own_inverse
    both = bread.gain @ inverse @ (ahead @ scores[:, :, s:]) @ bread.own_inverse
    own = np.diagonal(moved + alone + both + both.transpose(0, 2, 1), axis1=1, axis2=2)
    return shared, own, open_shared & bread.free_shared


def uncertainty(
    problem: RecordedResiduals,
    evaluated: Rows,
    shared: Array,
    own: Array,
    which: Ints,
    loss: RobustLoss,
    noise_known: bool,
) -> Uncertainty:
    """Of the estimates shared (s,) and own (K, o), from the recordings in ``which`` and their Jacobian there.

    The quantile is Student's where the noise is estimated, else the normal one.
    """
    given = (problem, evaluated, shared, own, which, loss, np.ones(len(which)))
    slopes = assemble(*given)
    free_shared = movable(problem.shared, shared, slopes.shared_gradient)
    free_own = movable(problem.own, own, slopes.own_gradient, which)
    system = squares = slopes
    if loss.robust:
        share = float(np.mean(np.concatenate([loss.inside(r) for r, _, _ in evaluated])))
        system = assemble(*given, lambda r: np.full(r.shape, share))
        squares = assemble(*given, lambda r: loss.influence(r) ** 2)
    bread = make_information(system, free_shared, free_own)
    covariance, own_variance, open_shared = covariances(bread, squares)
    size = sum(len(r) for r, _, _ in evaluated)
    freedom = size - int(free_shared.sum()) - int(free_own.sum())
    if loss.robust:
        correction = size / max(freedom, 1)
        covariance, own_variance = covariance * correction, own_variance * correction
    covariance = covariance * np.outer(problem.shared.scale, problem.shared.scale)
    covariance[open_shared, open_shared] = np.inf
    covariance[~free_shared, :] = covariance[:, ~free_shared] = np.nan
    error = np.sqrt(np.diagonal(covariance))
    own_error = np.full(own.shape, np.nan)
    units = number_units((problem.shared, problem.own), (shared, own), (free_shared, free_own), which)
    vague_own = DeterminedArrow(system, units).vague_own
    open_own = bread.own_open | vague_own | np.any((np.abs(bread.gain) > TOUCHED) & open_shared, axis=2)
    fitted = np.where(open_own, np.inf, np.sqrt(np.maximum(own_variance, 0))) * problem.own.scale[which]
    own_error[which] = np.where(free_own, fitted, np.nan)
    correlation, known = np.full(covariance.shape, np.nan), np.flatnonzero(np.isfinite(error) & (error > 0))
    some = np.ix_(known, known)
    correlation[some] = covariance[some] / np.outer(error[known], error[known])
    tail = (1 + LEVEL) / 2
    quantile = float(scipy.stats.norm.ppf(tail) if noise_known else scipy.stats.t.ppf(tail, max(freedom, 1)))
    own_free = np.ones(own.shape, bool)
    own_free[which] = free_own
    sides = (at_bound(problem.shared, shared, free_shared), at_bound(problem.own, own, own_free))
    return Uncertainty(covariance, error, own_error, correlation, quantile, freedom, *sides, bread)


def at_bound(parameters: FitParameters, values: Array, free: Bools) -> Ints:
    """-1 for numbers that the lower bound holds, 1 for the upper one, else 0."""
    return np.where(free, 0, np.where(values <= parameters.lower, -1, 1))
