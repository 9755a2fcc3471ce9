"""The forward pass: motions under a policy, one for each step length, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symphys.shooting import StagedMotion, StagedProblem
from symphys.solvers.ddp.backward_pass import Policy
from symphys.solvers.ddp.knots import KnotStep

Array = NDArray[np.float64]


class MotionBatch(NamedTuple):
    """A batch: ``z`` (B, len(z)), ``x`` (B, N + 1, nx), ``u`` (B, N, m)."""

    z: Array
    x: Array
    u: Array

    def motion(self, row: int, smoothing: float) -> StagedMotion:
        """One of them."""
        return StagedMotion(self.z[row], self.x[row], self.u[row], smoothing)


def forward_pass(
    problem: StagedProblem,
    motion: StagedMotion,
    policy: Policy,
    knots: Sequence[KnotStep],
    lengths: Array,
    bounds: tuple[Array, Array],
) -> MotionBatch:
    """The motions of step lengths (B,), their z within bounds (len(z),) each.

    A motion that is not finite stays so to its end.
    """
    lower, upper = bounds
    z = np.repeat(motion.z[None], len(lengths), axis=0)
    statics = problem.statics
    z[:, statics] = np.clip(motion.z[statics] + lengths[:, None] * policy.statics, lower[statics], upper[statics])
    x = np.empty((len(lengths), problem.steps + 1, problem.state_size))
    u = np.empty((len(lengths), problem.steps, problem.input_size))
    x[:, 0] = problem.start(z)
    for k, (knot, gain) in enumerate(zip(knots, policy.gains, strict=True)):
        if gain is not None:
            off = problem.difference(np.repeat(motion.x[None, k], len(lengths), axis=0), x[:, k])
            parts = (off, z[:, knot.old] - motion.z[knot.old], z[:, statics] - motion.z[statics])
            answer = np.concatenate(parts, axis=1) @ gain.back.T
            wanted = motion.z[knot.new] + lengths[:, None] * gain.ahead + answer
            z[:, knot.new] = np.clip(wanted, lower[knot.new], upper[knot.new])
        u[:, k] = z[:, knot.acting] @ knot.weights.T
        x[:, k + 1] = problem.step(k, x[:, k], u[:, k], z, motion.smoothing)
    return MotionBatch(z, x, u)
