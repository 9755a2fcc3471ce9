"""The knots of the controls: in which steps each acts, and in which step it is decided."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from symphys.records import dataclass
from symphys.shooting import StagedProblem
from symphys.types import Array, Ints


@dataclass(frozen=True)
class KnotStep:
    """The knots of one step, by their entries in z.

    Attributes:
        old: (o,) decided in steps before.
        new: (w,) decided here: it is the first step in which they act.
        weights: (m, o + w): u = weights @ z[old, new].
        kept: (o',) places among old and new of those that the next step has as its ``old``.
    """

    old: Ints
    new: Ints
    weights: Array
    kept: Ints

    @property
    def acting(self) -> Ints:
        """Return (o + w,) the entries of all knots that act in the step."""
        return np.concatenate([self.old, self.new])


class KnotSteps(list[KnotStep]):
    """The knots of all steps."""

    @cached_property
    def aligned(self) -> bool:
        """Whether each knot acts in one step, and all steps have equally many."""
        return not self.padded.old.size and bool(self.padded.new.size and (self.padded.new >= 0).all())

    @cached_property
    def padded(self) -> KnotArrays:
        """Return the knots of all steps as arrays, padded with knots that are none."""
        count = len(self)
        o, w = (max(len(getattr(each, name)) for each in self) for name in ("old", "new"))
        old, new = np.full((count, o), -1), np.full((count, w), -1)
        weights, keep = np.zeros((count, self[0].weights.shape[0], o + w)), np.zeros((count, o, o + w))
        for k, step in enumerate(self):
            places = np.concatenate([np.arange(len(step.old)), o + np.arange(len(step.new))])
            old[k, : len(step.old)], new[k, : len(step.new)] = step.old, step.new
            weights[k][:, places] = step.weights
            keep[k, np.arange(len(step.kept)), places[step.kept]] = 1.0
        return KnotArrays(old, new, weights, keep)


@dataclass(frozen=True)
class KnotArrays:
    """The knots of N steps: at most o old ones and w new ones.

    Attributes:
        old, new: (N, o) and (N, w) entries of z; -1 where there is none.
        weights: (N, m, o + w): u = weights @ (old, new); 0 where there is none.
        keep: (N, o, o + w): the old ones of the next step.
    """

    old: Ints
    new: Ints
    weights: Array
    keep: Array


@dataclass(frozen=True)
class PaddedKnots:
    """The knots of all steps as arrays: at most o old ones and w new ones, padded with zeros.

    Attributes:
        steps: N of them.
        old, new: (N, o) and (N, w) entries of z; one past its end where there is none.
        weights: (N, m, o + w): u = weights @ (old, new).
        keep: (N, o, o + w): the old ones of the next step.
        lower, upper: (len(z) + 1,) bounds; the last is of what is none.
    """

    steps: KnotSteps
    old: Ints
    new: Ints
    weights: Array
    keep: Array
    lower: Array
    upper: Array

    @staticmethod
    def of(steps: KnotSteps, lower: Array, upper: Array) -> PaddedKnots:
        """Make the arrays of steps, with bounds of z (len(z),)."""
        made, none = steps.padded, len(lower)
        old, new = (np.where(each < 0, none, each) for each in (made.old, made.new))
        weights, keep = made.weights, made.keep
        return PaddedKnots(steps, old, new, weights, keep, np.append(lower, 0.0), np.append(upper, 0.0))

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Return lower and upper bounds (N, w) of the new knots."""
        return self.lower[self.new], self.upper[self.new]


def knot_steps(problem: StagedProblem) -> KnotSteps:
    """Return the knots of each step; knots that never act are in none."""
    steps, m, weights = problem.steps, problem.input_size, problem.weights.tocsr().tocoo()
    rows, columns, values = (each[weights.data != 0] for each in (weights.row, weights.col, weights.data))
    at, count = rows // max(m, 1), weights.shape[1]
    first, last = np.full(count, steps), np.full(count, -1)
    np.minimum.at(first, columns, at)
    np.maximum.at(last, columns, at)
    order = np.argsort(at, kind="stable")
    ends = np.searchsorted(at[order], np.arange(steps + 1))
    begun = np.argsort(first, kind="stable")
    begins = np.searchsorted(first[begun], np.arange(steps + 1))
    found, old, place = KnotSteps(), np.zeros(0, np.int64), np.zeros(count, np.int64)
    for k in range(steps):
        new = begun[begins[k] : begins[k + 1]]
        acting = np.concatenate([old, new])
        place[acting] = np.arange(len(acting))
        entries, block = order[ends[k] : ends[k + 1]], np.zeros((m, len(acting)))
        block[rows[entries] - k * m, place[columns[entries]]] = values[entries]
        kept = np.flatnonzero(last[acting] > k)
        found.append(KnotStep(old, new, block, kept))
        old = acting[kept]
    return found
