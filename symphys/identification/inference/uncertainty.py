"""Standard errors, 95 % intervals and correlations of the estimates, from the Jacobian there.

With H the arrow of second derivatives and M that of the squares of the scores, the covariance is H^-1 M H^-1. In least
squares M is H, and the covariance its inverse, which is the Cramer-Rao bound under normal noise. Under Huber's loss M
has psi^2 and H psi': the sandwich (Huber 1967, White 1980). Residuals are in units of the noise, whether it is given or
estimated (``noise``), so no factor is left.

The own numbers are eliminated, recording by recording, and all of it is done with square roots (``square_root``), so
that a Jacobian of condition 1e12 has its errors. What has no information is what the rounding of the derivatives makes:
where a singular value is small enough to ask, the Jacobian is evaluated once more, some units of the last digit away
(``derivative_noise``). Numbers without effect have no part in the errors of the others.

Numbers at a bound are held: their intervals are nan, and those of the others hold under that condition. A direction
without information has the standard error inf, and so has an own number that takes part in a vague one (``remaining``):
that of the Jacobian is beyond where the Jacobian holds.
"""

from __future__ import annotations

import numpy as np
import scipy.stats

from symphys.identification.fitting.arrow import ArrowSystem, assemble
from symphys.identification.fitting.levenberg_marquardt import movable_numbers
from symphys.identification.fitting.remaining import DeterminedArrow, number_units
from symphys.identification.fitting.robust_loss import RobustLoss
from symphys.identification.fitting.square_root import (
    EPS,
    MIN_TOUCHED_COMPONENT,
    Root,
    eliminate,
    pseudo_root,
    stacked,
    triangle,
)
from symphys.identification.interface import FitParameters, RecordedResiduals, Rows
from symphys.records import dataclass
from symphys.types import Array, Bools, Ints

CONFIDENCE_LEVEL = 0.95
"""Probability of the intervals."""
SUSPICIOUS = 1e-8
"""Relative singular values below which the rounding of the derivatives is measured."""
RELATIVE_NUDGE = 8 * EPS
"""Relative change of all numbers with which the Jacobian is evaluated again, to measure its rounding."""
MAX_DERIVATIVE_NOISE = 1e-9
"""Largest rounding, relative to the longest column; a larger change comes from a kink."""


@dataclass(frozen=True, eq=False)
class Information:
    """The arrow at an estimate with own numbers eliminated, in scaled numbers; k fitted recordings.

    Attributes:
        shared: the root of the Schur complement S, priors included.
        left: (k, n, s) what each recording adds to it, as rows: S is the sum of left' left.
        own: roots of the own blocks D.
        gain: (k, o, s) -D^-1 B', how the own estimates follow the shared ones.
        free_shared, free_own: (s,), (k, o) False for what a bound holds.
    """

    shared: Root
    left: Array
    own: Root
    gain: Array
    free_shared: Bools
    free_own: Bools

    @property
    def own_open(self) -> Bools:
        """Return (k, o) the own numbers that take part in a direction without information."""
        return self.own.touched & self.free_own

    @property
    def suspicious(self) -> bool:
        """Whether something may be rounding."""
        own = np.min(self.own.weakest, initial=1.0)
        lost = self.shared.touched[self.free_shared].any() or self.own_open.any()
        return bool(lost or min(float(own), float(self.shared.weakest)) < SUSPICIOUS)


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The uncertainty of s shared and o own numbers of K recordings, in their own units.

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
        """Return (s, 2) the intervals about the shared estimates (s,)."""
        half = self.quantile * self.error
        return np.stack([value - half, value + half], axis=1)


def make_information(
    system: ArrowSystem, free_shared: Bools, free_own: Bools, noise: tuple[Array, Array] | None = None
) -> Information:
    """Eliminate the own numbers of an arrow, of whose numbers (s,) and (k, o) are free.

    ``noise``: (k, n, n) rows of the rounding of the roots, and (k, o) the lengths of its own columns.
    """
    s = system.s
    free = np.concatenate([np.broadcast_to(free_shared, (len(free_own), s)), free_own], axis=1)
    rounding, own_noise = (np.zeros_like(system.roots), np.zeros(free_own.shape)) if noise is None else noise
    found = eliminate(system.roots * free[:, None], s, own_noise)
    rows = np.concatenate([stacked(found.left), np.diag(np.sqrt(system.prior_block) * free_shared)])
    moved = rounding[:, :, :s] + rounding[:, :, s:] @ found.gain
    lengths = np.linalg.norm(stacked(moved), axis=0)
    longest = float(np.max(np.linalg.norm(rows, axis=0), initial=0.0))
    shared = pseudo_root(triangle(rows), np.minimum(lengths, MAX_DERIVATIVE_NOISE * longest) * free_shared)
    return Information(shared, found.left, found.own, found.gain, free_shared, free_own)


def covariances(bread: Information, meat: ArrowSystem) -> tuple[Array, Array, Bools]:
    """Return scaled covariances H^-1 M H^-1: (s, s), (k, o) variances of own numbers, (s,) open shared ones."""
    s, inverse = meat.s, bread.shared.square
    ahead = meat.roots[:, :, :s] + meat.roots[:, :, s:] @ bread.gain
    moves = ahead @ bread.shared.whitener @ bread.shared.whitener.T
    prior = np.sqrt(meat.prior_block)[:, None] * inverse
    shared = np.einsum("kna,knb->ab", moves, moves) + prior.T @ prior
    followed = moves @ bread.gain.transpose(0, 2, 1)
    alone = meat.roots[:, :, s:] @ bread.own.whitener @ bread.own.whitener.transpose(0, 2, 1)
    by_shared = np.einsum("kos,st,kot->ko", bread.gain, shared, bread.gain)
    own = by_shared + np.sum(alone * (alone + 2 * followed), axis=1)
    return shared, own, bread.shared.touched & bread.free_shared


def derivative_noise(
    problem: RecordedResiduals, evaluated: Rows, shared: Array, own: Array, which: Ints, loss: RobustLoss
) -> tuple[Array, Array]:
    """Measure the rounding of the Jacobian: its change when all numbers change in their last digits.

    Returns:
        (k, n, n) roots of the changes of each recording, and (k, o) lengths of those of its own columns, in scales.
    """
    nudged = [
        np.clip(
            values + RELATIVE_NUDGE * np.maximum(np.abs(values), parameters.scale), parameters.lower, parameters.upper
        )
        for parameters, values in ((problem.shared, shared), (problem.own, own))
    ]
    again, s, n = problem.jacobian(nudged[0], nudged[1], which), len(shared), len(shared) + own.shape[1]
    found, longest = np.zeros((len(which), n, n)), np.zeros(len(which))
    for k, (first, second) in enumerate(zip(evaluated, again, strict=True)):
        scale = np.concatenate([problem.shared.scale, problem.own.scale[which[k]]])
        weight = np.sqrt(loss.weight(first[0]))[:, None] * scale
        changed = np.concatenate([second[1] - first[1], second[2] - first[2]], axis=1) * weight
        if np.isfinite(changed).all():
            found[k] = triangle(changed)
        longest[k] = np.max(np.linalg.norm(first[2] * weight[:, s:], axis=0), initial=0.0)
    own_lengths = np.linalg.norm(found[:, :, s:], axis=1)
    return found, np.minimum(own_lengths, MAX_DERIVATIVE_NOISE * longest[:, None])


def uncertainty(
    problem: RecordedResiduals,
    evaluated: Rows,
    shared: Array,
    own: Array,
    which: Ints,
    loss: RobustLoss,
    noise_known: bool,
) -> Uncertainty:
    """Compute the uncertainty of shared (s,) and own (K, o) estimates from the Jacobian of recordings there.

    The quantile is Student's where the noise is estimated, else the normal one.
    """
    given = (problem, evaluated, shared, own, which, loss, np.ones(len(which)))
    slopes = assemble(*given)
    free_shared = movable_numbers(problem.shared, shared, slopes.shared_gradient)
    free_own = movable_numbers(problem.own, own, slopes.own_gradient, which)
    system = squares = slopes
    if loss.robust:
        share = float(np.mean(np.concatenate([loss.inside(r) for r, _, _ in evaluated])))
        system = assemble(*given, lambda r: np.full(r.shape, share))
        squares = assemble(*given, lambda r: loss.influence(r) ** 2)
    bread = make_information(system, free_shared, free_own)
    if bread.suspicious:
        noise = derivative_noise(problem, evaluated, shared, own, which, loss)
        bread = make_information(system, free_shared, free_own, noise)
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
    open_own = bread.own_open | vague_own | np.any((np.abs(bread.gain) > MIN_TOUCHED_COMPONENT) & open_shared, axis=2)
    fitted = np.where(open_own, np.inf, np.sqrt(np.maximum(own_variance, 0))) * problem.own.scale[which]
    own_error[which] = np.where(free_own, fitted, np.nan)
    correlation, known = np.full(covariance.shape, np.nan), np.flatnonzero(np.isfinite(error) & (error > 0))
    some = np.ix_(known, known)
    correlation[some] = covariance[some] / np.outer(error[known], error[known])
    tail = (1 + CONFIDENCE_LEVEL) / 2
    quantile = float(scipy.stats.norm.ppf(tail) if noise_known else scipy.stats.t.ppf(tail, max(freedom, 1)))
    own_free = np.ones(own.shape, bool)
    own_free[which] = free_own
    sides = (at_bound(problem.shared, shared, free_shared), at_bound(problem.own, own, own_free))
    return Uncertainty(covariance, error, own_error, correlation, quantile, freedom, *sides, bread)


def at_bound(parameters: FitParameters, values: Array, free: Bools) -> Ints:
    """Return -1 for numbers at the lower bound, 1 at the upper one, else 0."""
    return np.where(free, 0, np.where(values <= parameters.lower, -1, 1))
