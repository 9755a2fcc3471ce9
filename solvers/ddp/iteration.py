"""One iteration of iLQR about a motion: quadratic expansion, policy, and line search along it.

The solver ``ilqr`` and model predictive control iterate by this. They differ in what a motion is worth, in how damping
follows success, and in how often they iterate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from itertools import tee
from typing import NamedTuple

import numpy as np

from symphys.shooting import Linearized, StagedMotion, StagedProblem
from symphys.solvers.ddp.backward_pass import Bounds, Policy, backward_pass
from symphys.solvers.ddp.forward_pass import MotionBatch, forward_pass
from symphys.solvers.ddp.knots import PaddedKnots
from symphys.types import Array

STEP_LENGTHS = 0.5 ** np.arange(8.0)
"""Step lengths of a line search, which are evaluated in two batches."""
LONG = 4
"""How many of them are in the first batch; most searches end there."""


class BestMotion(NamedTuple):
    """The best motion of a line search.

    Attributes:
        motion: itself.
        value: of the augmented objective.
        length: of the step.
        expected: the fall of the objective that the policy expects of it.
        tried: how many step lengths were evaluated.
    """

    motion: StagedMotion
    value: float
    length: float
    expected: float
    tried: int


class LocalExpansion:
    """The quadratic expansion of a problem about a motion.

    Attributes:
        bounds: of changes of z.
    """

    def __init__(
        self,
        problem: StagedProblem,
        motion: StagedMotion,
        limits: tuple[Array, Array],
        knots: PaddedKnots,
        scale: Array,
        slopes: Iterable[Linearized] | None = None,
    ) -> None:
        """Expand the objective while threads compute the slopes of the steps.

        Args:
            problem: to expand.
            motion: about which.
            limits: (c,) multipliers and penalties of its limits.
            knots: of the problem.
            scale: (len(z),) of the decision vector.
            slopes: of the steps, from the last one, where these are begun already.
        """
        self.problem, self.motion, self.knots = problem, motion, knots
        self._slopes = problem.linearize_from_end(motion) if slopes is None else slopes
        self._costs = problem.expand(motion, *limits)
        self.bounds = Bounds(knots.lower[:-1] - motion.z, knots.upper[:-1] - motion.z, scale)

    def policy(self, damping: float, gradient: bool = True) -> Policy | None:
        """Run the backward pass; see ``backward_pass``."""
        runs, self._slopes = tee(self._slopes)
        statics = self.problem.statics
        compiled = self.problem.recursion
        return backward_pass(runs, self._costs, self.knots.steps, statics, self.bounds, damping, gradient, compiled)

    def search(self, policy: Policy, values: Callable[[MotionBatch], Array]) -> BestMotion:
        """Return the best motion of the policy; ``values`` (B,) of motions decide.

        Half of the step lengths are evaluated only where the shortest of the others is the best.
        """
        best = self._best(policy, values, STEP_LENGTHS[:LONG])
        if best.length > STEP_LENGTHS[LONG - 1] and best.value < math.inf:
            return best
        more = self._best(policy, values, STEP_LENGTHS[LONG:])
        return (more if more.value < best.value else best)._replace(tried=len(STEP_LENGTHS))

    def _best(self, policy: Policy, values: Callable[[MotionBatch], Array], lengths: Array) -> BestMotion:
        """Return the best motion of some step lengths, which are evaluated in one batch."""
        motions = forward_pass(self.problem, self.motion, policy, self.knots, lengths)
        found = values(motions)
        found = np.where(np.isfinite(found), found, math.inf)
        best = int(found.argmin())
        length = float(lengths[best])
        expected = -(length * policy.first + length**2 * policy.second)
        motion = motions.motion(best, self.motion.smoothing)
        return BestMotion(motion, float(found[best]), length, expected, len(lengths))
