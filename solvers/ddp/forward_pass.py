"""The forward pass: motions under a policy, one for each step length, side by side."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from symphys.shooting import AffinePolicy, StagedMotion, StagedProblem
from symphys.solvers.ddp.backward_pass import KnotGain, Policy
from symphys.solvers.ddp.knots import KnotStep, PaddedKnots
from symphys.types import Array


class MotionBatch(NamedTuple):
    """A batch: ``z`` (B, len(z)), ``x`` (B, N + 1, nx), ``u`` (B, N, m)."""

    z: Array
    x: Array
    u: Array

    def motion(self, row: int, smoothing: float) -> StagedMotion:
        """One of them."""
        return StagedMotion(self.z[row], self.x[row], self.u[row], smoothing)


def forward_pass(
    problem: StagedProblem, motion: StagedMotion, policy: Policy, knots: PaddedKnots, lengths: Array
) -> MotionBatch:
    """The motions of step lengths (B,), their z within the bounds of ``knots``.

    A motion that is not finite stays so to its end.
    """
    lower, upper = knots.lower, knots.upper
    z = np.repeat(motion.z[None], len(lengths), axis=0)
    statics = problem.statics
    z[:, statics] = np.clip(motion.z[statics] + lengths[:, None] * policy.statics, lower[statics], upper[statics])
    found = problem.follow(affine(motion, policy, knots), motion.z, z, lengths, motion.smoothing)
    if found is None:
        return _step_by_step(problem, motion, policy, knots, lengths, z)
    x, u, new = found
    chosen = knots.new < len(motion.z)
    z[:, knots.new[chosen]] = new[:, chosen]
    return MotionBatch(z, x, u)


def affine(motion: StagedMotion, policy: Policy, knots: PaddedKnots) -> AffinePolicy:
    """The policy in arrays."""
    z, (count, o), s = np.append(motion.z, 0.0), knots.old.shape, len(policy.statics)
    n = next((gain.back.shape[1] - len(step.old) - s for gain, step in _pairs(policy, knots) if gain is not None), 0)
    ahead, back = np.zeros(knots.new.shape), np.zeros((*knots.new.shape, n + o + s))
    for k, (gain, step) in enumerate(_pairs(policy, knots)):
        if gain is not None:
            rows, end = len(gain.ahead), n + len(step.old)
            ahead[k, :rows], back[k, :rows, :end] = gain.ahead, gain.back[:, :end]
            back[k, :rows, n + o :] = gain.back[:, end:]
    lower, upper = knots.lower[knots.new], knots.upper[knots.new]
    parts = motion.x[:count], z[knots.old], z[knots.new], ahead, back, knots.weights, knots.keep
    return AffinePolicy(*parts, lower, upper)


def _pairs(policy: Policy, knots: PaddedKnots) -> Iterator[tuple[KnotGain | None, KnotStep]]:
    return zip(policy.gains, knots.steps, strict=True)


def _step_by_step(
    problem: StagedProblem, motion: StagedMotion, policy: Policy, knots: PaddedKnots, lengths: Array, z: Array
) -> MotionBatch:
    """The motions from z (B, len(z)), whose static entries hold."""
    lower, upper, statics = knots.lower, knots.upper, problem.statics
    x = np.empty((len(lengths), problem.steps + 1, problem.state_size))
    u = np.empty((len(lengths), problem.steps, problem.input_size))
    x[:, 0] = problem.start(z)
    for k, (gain, knot) in enumerate(_pairs(policy, knots)):
        if gain is not None:
            off = problem.difference(np.repeat(motion.x[None, k], len(lengths), axis=0), x[:, k])
            parts = (off, z[:, knot.old] - motion.z[knot.old], z[:, statics] - motion.z[statics])
            answer = np.concatenate(parts, axis=1) @ gain.back.T
            wanted = motion.z[knot.new] + lengths[:, None] * gain.ahead + answer
            z[:, knot.new] = np.clip(wanted, lower[knot.new], upper[knot.new])
        u[:, k] = z[:, knot.acting] @ knot.weights.T
        x[:, k + 1] = problem.step(k, x[:, k], u[:, k], z, motion.smoothing)
    return MotionBatch(z, x, u)
