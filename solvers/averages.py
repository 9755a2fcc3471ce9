"""What many situations make of a point: a direction from their gradients, and one from their values alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symphys.shooting import Drawn, Situations, Values
from symphys.solvers.outcome import Array

TINY, LARGEST = 1e-300, 1e300


@dataclass(frozen=True)
class Average:
    """Of a batch.

    Attributes:
        gradient: (n,) mean of the gradients, each scaled and shortened first.
        objective, merit: means of those that are finite.
        errors: (k,) of the problem's own situation, the first.
        alive: share of the motions that lasted.
        agreement: length of the mean of the gradients' directions: 1 where all agree, 0 where they cancel.
        typical, longest: median and largest norm of the scaled gradients.
        left_out: how many were not finite.
    """

    gradient: Array
    objective: float
    merit: float
    errors: Array
    alive: float
    agreement: float
    typical: float
    longest: float
    left_out: int


def average(values: Values, scale: Array, clip: float, fallen: float) -> Average:
    """Each gradient by itself at most ``clip`` long, then their mean; motions that fell count ``fallen`` times."""
    assert values.gradient is not None, "gradients were asked for"
    g = values.gradient * scale
    finite = np.isfinite(values.merit) & np.isfinite(g).all(axis=1)
    g = g[finite]
    largest = np.maximum(np.abs(g).max(axis=1, initial=0.0), TINY)
    directions = g / largest[:, None]
    lengths = np.maximum(np.linalg.norm(directions, axis=1), TINY)
    directions, norms = directions / lengths[:, None], largest * np.minimum(lengths, LARGEST / np.maximum(largest, 1))
    lasted = np.ones(len(finite)) if values.alive is None else values.alive
    weights = np.where(lasted[finite] > 0, 1.0, fallen)
    short = directions * np.minimum(norms, clip)[:, None]
    return Average(
        gradient=weights @ short / max(weights.sum(), TINY),
        objective=mean(values.objective[finite]),
        merit=mean(values.merit[finite]),
        errors=values.errors[0],
        alive=float((lasted * finite).mean()),
        agreement=float(np.linalg.norm(directions.mean(axis=0))) if len(directions) else np.nan,
        typical=float(np.median(norms)) if len(norms) else np.nan,
        longest=float(norms.max(initial=0.0)),
        left_out=int((~finite).sum()),
    )


def mean(numbers: Array) -> float:
    """Of those that there are."""
    return float(numbers.mean()) if numbers.size else np.nan


def evolution(
    situations: Situations,
    z: Array,
    step: Array,
    drawn: Drawn,
    smoothing: float,
    rng: np.random.Generator,
) -> Array:
    """(n,) a descent direction's gradient from values: z moved to either side at random in each situation.

    Antithetic pairs (Salimans et al. 2017, arXiv 1703.03864, without their ranks): the mean of
    (J(z + s e) - J(z - s e)) / 2 e over situations, in units of ``step`` = s (n,); a pair that is not finite is left
    out.
    """
    noise = rng.standard_normal((len(drawn.numbers), z.size))
    high, low = (situations.value(z + sign * step * noise, drawn, smoothing).merit for sign in (1, -1))
    difference = (high - low) / 2
    known = np.isfinite(difference)
    return np.asarray(difference[known] @ noise[known] / max(int(known.sum()), 1))


def together(pathwise: Array, evolved: Array, share: float) -> Array:
    """Both at length 1, mixed by their shares."""
    parts = [(1 - share, pathwise), (share, evolved)]
    return np.asarray(sum(weight * g / max(float(np.linalg.norm(g)), TINY) for weight, g in parts))
