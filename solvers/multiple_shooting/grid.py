"""The grid of multiple shooting: the intervals between nodes, and the entries of z that act in each.

Node j is the state before step ``starts[j]``. Node 0 is the first state, which z decides; the last node is the state
after the last step. Interval j leads from node j to node j + 1. A stage is an interval with the states that begin its
steps; the last stage is the last node alone. The local vector of a stage holds all that its states depend on: the
tangent of its node (none at node 0), the knots of its inputs, and the static entries of z.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from symphys.records import dataclass
from symphys.shooting import StagedProblem
from symphys.types import Array, Ints

MAX_INTERVALS = 40
"""Largest number of intervals of the default grid."""


@dataclass(frozen=True)
class IntervalGrid:
    """Intervals and the entries of z that act in them.

    Attributes:
        starts: (M + 1,) first step of each interval, then the number of steps.
        knots: M arrays, the entries of z that the inputs of an interval depend on, in ascending order.
        shares: M arrays (steps, m, knots), the inputs of an interval's steps by its knots.
        statics: (s,) entries of z, see ``StagedProblem``.
        tangent_size: n.
    """

    starts: Ints
    knots: tuple[Ints, ...]
    shares: tuple[Array, ...]
    statics: Ints
    tangent_size: int

    @property
    def intervals(self) -> int:
        """Return the number of intervals ``M``."""
        return len(self.knots)

    def node_size(self, stage: int) -> int:
        """Return how many entries of a local vector are the tangent of the node: none at node 0."""
        return self.tangent_size if stage else 0

    def local_size(self, stage: int) -> int:
        """Return the length of the local vector of a stage."""
        knots = len(self.knots[stage]) if stage < self.intervals else 0
        return self.node_size(stage) + knots + len(self.statics)

    def static_part(self, stage: int) -> slice:
        """Return the slice of the static entries of a local vector."""
        size = self.local_size(stage)
        return slice(size - len(self.statics), size)

    def knot_part(self, stage: int) -> slice:
        """Return the slice of the knots of a local vector."""
        return slice(self.node_size(stage), self.local_size(stage) - len(self.statics))

    def states(self, stage: int) -> range:
        """Return the indices of the states of a stage."""
        last = int(self.starts[-1])
        return range(last, last + 1) if stage == self.intervals else self.steps(stage)

    def steps(self, interval: int) -> range:
        """Return the steps of an interval."""
        return range(int(self.starts[interval]), int(self.starts[interval + 1]))

    @property
    def stage_of_state(self) -> Ints:
        """Return (N + 1,) the stage of each state."""
        return np.searchsorted(self.starts, np.arange(self.starts[-1] + 1), side="right") - 1


def make_grid(problem: StagedProblem, steps_between_nodes: int) -> IntervalGrid:
    """Make the grid with a node every so many steps; 0: at most ``MAX_INTERVALS`` intervals."""
    steps = steps_between_nodes or -(-problem.steps // MAX_INTERVALS)
    starts = np.append(np.arange(0, problem.steps, steps), problem.steps).astype(np.int64)
    m, weights = problem.input_size, problem.weights.tocsr()
    knots, shares = [], []
    for first, last in pairwise(starts.tolist()):
        part = weights[first * m : last * m]
        acting = np.unique(part.indices[part.data != 0]).astype(np.int64)
        knots.append(acting)
        shares.append(part[:, acting].toarray().reshape(last - first, m, len(acting)))
    statics = np.asarray(problem.statics, np.int64)
    return IntervalGrid(starts, tuple(knots), tuple(shares), statics, problem.tangent_size)
