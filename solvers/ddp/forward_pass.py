"""The forward pass: rollouts under a policy, one for each step length, in one batch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symphys.shooting import AffinePolicy, Followed, StagedMotion, StagedProblem
from symphys.solvers.ddp.backward_pass import Policy
from symphys.solvers.ddp.knots import PaddedKnots
from symphys.types import Array


class MotionBatch(NamedTuple):
    """A batch: ``z`` (B, len(z)), ``x`` (B, N + 1, nx), ``u`` (B, N, m), and ``merit`` (B,) where it is known."""

    z: Array
    x: Array
    u: Array
    merit: Array | None = None

    def motion(self, row: int, smoothing: float) -> StagedMotion:
        """Return the motion of a row."""
        return StagedMotion(self.z[row], self.x[row], self.u[row], smoothing, gapless=True)


def forward_pass(
    problem: StagedProblem, motion: StagedMotion, policy: Policy, knots: PaddedKnots, lengths: Array
) -> MotionBatch:
    """Return the motions of step lengths (B,), with z within the bounds of ``knots``.

    A motion that is not finite stays so to its end.
    """
    lower, upper = knots.lower, knots.upper
    z = np.repeat(motion.z[None], len(lengths), axis=0)
    statics = problem.statics
    if len(statics):
        z[:, statics] = np.clip(motion.z[statics] + lengths[:, None] * policy.statics, lower[statics], upper[statics])
    x, u, new, merit = follow_policy(problem, affine(motion, policy, knots), motion.z, z, lengths, motion.smoothing)
    if knots.steps.aligned:
        z[:, knots.new] = new
    else:
        chosen = knots.new < len(motion.z)
        z[:, knots.new[chosen]] = new[:, chosen]
    return MotionBatch(z, x, u, merit)


def affine(motion: StagedMotion, policy: Policy, knots: PaddedKnots) -> AffinePolicy:
    """Return the policy as arrays."""
    z, count = np.append(motion.z, 0.0), len(knots.new)
    about = motion.x[:count], z[knots.old], z[knots.new]
    return AffinePolicy(*about, policy.ahead, policy.back, knots.weights, knots.keep, *knots.bounds)


def follow_policy(
    problem: StagedProblem,
    policy: AffinePolicy,
    about: Array,
    z: Array,
    lengths: Array,
    smoothing: float,
    shares: Array | float = 1.0,
) -> Followed:
    """Return the motions of ``StagedProblem.follow``, step by step where that is not compiled."""
    found = problem.follow(policy, about, z, lengths, smoothing, shares)
    if found is not None:
        return found
    count, (steps, inputs, _), nx = len(lengths), policy.weights.shape, problem.state_size
    x, u, new = (np.empty((count, *sizes)) for sizes in ((steps + 1, nx), (steps, inputs), policy.new.shape))
    off_statics = z[:, problem.statics] - about[problem.statics]
    held, share = np.repeat(policy.old[:1], count, axis=0), np.reshape(shares, (-1, 1))
    x[:, 0] = problem.start(z)
    for k in range(steps):
        off = problem.difference(np.repeat(policy.x[None, k], count, axis=0), x[:, k])
        beside = np.concatenate([off, held - policy.old[k], off_statics], axis=1)
        answer = beside @ policy.back[k].T if policy.new.shape[1] else 0.0
        wanted = policy.new[k] + lengths[:, None] * policy.ahead[k] + share * answer
        new[:, k] = np.clip(wanted, policy.lower[k], policy.upper[k])
        acting = np.concatenate([held, new[:, k]], axis=1)
        u[:, k], held = acting @ policy.weights[k].T, acting @ policy.keep[k].T
        x[:, k + 1] = problem.step(k, x[:, k], u[:, k], z, smoothing)
    return x, u, new, None
