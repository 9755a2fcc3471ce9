"""Aggregation over samples of a scenario: a gradient from the samples' gradients, or from their values alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from symphys.records import dataclass
from symphys.shooting import ScenarioSamples, Values
from symphys.types import Array

MIN_LENGTH, MAX_LENGTH = 1e-300, 1e300
"""Bounds of lengths in divisions and products, against overflow."""


@dataclass(frozen=True)
class GradientAverage:
    """The average of a batch.

    Attributes:
        gradient: (n,) mean of the gradients, each scaled and shortened first.
        objective, merit: means of those that are finite.
        alive: share of the motions that lasted.
        agreement: length of the mean of the gradients' directions: 1 where all agree, 0 where they cancel.
        typical, longest: median and largest norm of the scaled gradients.
        left_out: how many were not finite.
    """

    gradient: Array
    objective: float
    merit: float
    alive: float
    agreement: float
    typical: float
    longest: float
    left_out: int


def average(values: Values, scale: Array, clip: float, fallen: float) -> GradientAverage:
    """Clip each gradient to ``clip``, then average; motions that fell have the weight ``fallen``."""
    assert values.gradient is not None, "gradients were asked for"
    g = values.gradient * scale
    finite = np.isfinite(values.merit) & np.isfinite(g).all(axis=1)
    g = g[finite]
    # Normalise by the largest entry first: norms of huge gradients would overflow.
    largest = np.maximum(np.abs(g).max(axis=1, initial=0.0), MIN_LENGTH)
    directions = g / largest[:, None]
    lengths = np.maximum(np.linalg.norm(directions, axis=1), MIN_LENGTH)
    directions, norms = (
        directions / lengths[:, None],
        largest * np.minimum(lengths, MAX_LENGTH / np.maximum(largest, 1)),
    )
    # Weighted mean of the clipped gradients.
    lasted = np.ones(len(finite)) if values.alive is None else values.alive
    weights = np.where(lasted[finite] > 0, 1.0, fallen)
    short = directions * np.minimum(norms, clip)[:, None]
    return GradientAverage(
        gradient=weights @ short / max(weights.sum(), MIN_LENGTH),
        objective=mean(values.objective[finite]),
        merit=mean(values.merit[finite]),
        alive=float((lasted * finite).mean()),
        agreement=float(np.linalg.norm(directions.mean(axis=0))) if len(directions) else np.nan,
        typical=float(np.median(norms)) if len(norms) else np.nan,
        longest=float(norms.max(initial=0.0)),
        left_out=int((~finite).sum()),
    )


def mean(numbers: Array) -> float:
    """Return the mean; nan without numbers."""
    return float(numbers.mean()) if numbers.size else np.nan


@dataclass(frozen=True)
class ValueGradient:
    """A gradient from values at antithetic pairs of points.

    Attributes:
        gradient: (n,) scaled.
        pairs: how many were finite.
        objective, merit: means over these.
        first: the values on one side, whose first sample is the problem's own.
        alive: share of the motions that lasted.
    """

    gradient: Array
    pairs: int
    objective: float
    merit: float
    first: Values
    alive: float


def evolution(
    evaluate: Callable[[Array, ScenarioSamples], Values],
    z: Array,
    step: Array,
    samples: ScenarioSamples,
    rng: np.random.Generator,
) -> ValueGradient:
    """Estimate a gradient from values: z is perturbed to either side at random in each sample.

    Antithetic pairs (Salimans et al. 2017, arXiv 1703.03864): the mean of (r(z + s e) - r(z - s e)) / 2 e over
    samples, in units of ``step`` = s (n,), where r is the rank of a merit among all that are finite, from -1/2 to
    1/2: how bad a fall is does not matter then, only that it is worse.
    """
    noise = rng.standard_normal((len(samples.numbers), z.size))
    sides = [evaluate(z + sign * step * noise, samples) for sign in (1, -1)]
    merits = np.stack([side.merit for side in sides])
    finite = np.isfinite(merits).all(axis=0)
    high, low = centred(merits[:, finite])
    pairs = int(finite.sum())
    objective = np.stack([side.objective for side in sides])[:, finite]
    lasted = [1.0 if side.alive is None else float(side.alive.mean()) for side in sides]
    return ValueGradient(
        gradient=np.asarray((high - low) / 2 @ noise[finite] / max(pairs, 1)),
        pairs=pairs,
        objective=mean(objective),
        merit=mean(merits[:, finite]),
        first=sides[0],
        alive=sum(lasted) / 2,
    )


def centred(merits: Array) -> Array:
    """Return ranks of all merits, from -1/2 to 1/2, in their shape; equal merits share a rank."""
    _, places, counts = np.unique(merits, return_inverse=True, return_counts=True)
    ranks = np.cumsum(counts) - (counts + 1) / 2
    return np.asarray(ranks[places].reshape(merits.shape) / max(merits.size - 1, 1) - 0.5)


def mixed(pathwise: Array, evolved: Array, share: float) -> Array:
    """Return the weighted sum of both gradients, each normalised."""
    parts = [(1 - share, pathwise), (share, evolved)]
    return np.asarray(sum(weight * g / max(float(np.linalg.norm(g)), MIN_LENGTH) for weight, g in parts))
