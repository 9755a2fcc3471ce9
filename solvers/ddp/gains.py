"""Feedback about a motion as named arrays, a row for each knot that is decided along the way; and rollouts under it.

A knot moves by ``by_state`` @ (how far the state at ``step`` is from ``states[step]``, in its tangent), and by
``by_others`` @ (how far the entries ``others`` of z are from ``z``): knots that were decided before and still act, and
static entries. Then it is put within its bounds. Knots that lie at a bound do not answer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from symphys.shooting import ShootingProblem, StagedMotion, StagedProblem
from symphys.solvers.ddp.backward_pass import Bounds, Policy, backward_pass
from symphys.solvers.ddp.knots import KnotStep, knot_steps
from symphys.types import Array

Gains = Mapping[str, Array]
"""Arrays by name, see ``gain_arrays``."""
DAMPINGS = 10.0 ** np.arange(-10, 3, 3)
"""Tried in order; the first with positive definite Hessians is taken."""


def gains_about(problem: ShootingProblem, z: Array, smoothing: float) -> dict[str, Array]:
    """Return the feedback about the motion of z (len(z),) by the merit; empty without a finite expansion."""
    assert problem.staged is not None, "the problem can be seen step by step"
    staged = problem.staged()
    motion = staged.roll_out(z, smoothing)
    if not np.isfinite(motion.x).all():
        return {}
    lower, upper, scale = (problem.stacked(name) for name in ("lower", "upper", "scale"))
    costs = staged.expand(motion, np.zeros(len(staged.lower)), 2 * staged.penalties)
    runs, knots, bounds = [*staged.linearize_from_end(motion)], knot_steps(staged), Bounds(lower - z, upper - z, scale)
    for damping in DAMPINGS.tolist():
        policy = backward_pass(runs, costs, knots, staged.statics, bounds, damping)
        if policy is not None:
            found = gain_arrays(motion, policy, knots, staged)
            return {**found, "by_state": staged.whole_gains(motion, found["step"].astype(np.int64), found["by_state"])}
    return {}


def gain_arrays(
    motion: StagedMotion, policy: Policy, knots: Sequence[KnotStep], problem: StagedProblem
) -> dict[str, Array]:
    """Return the arrays of K knots in the order of their steps; n is the tangent dimension.

    Returns:
        ``z`` (len(z),), ``states`` (N + 1, nx), ``step`` and ``knot`` (K,), ``by_state`` (K, n), ``others`` (K, q)
        entries of z, -1 for none, and ``by_others`` (K, q), 0 there.
    """
    statics, n = problem.statics, problem.tangent_size
    total = sum(len(knot.new) for knot in knots)
    width = max(len(knot.old) for knot in knots) + len(statics)
    step, entry, by_state = np.zeros(total, np.int64), np.zeros(total, np.int64), np.zeros((total, n))
    others, by_others = np.full((total, width), -1), np.zeros((total, width))
    first = 0
    for k, knot in enumerate(knots):
        rows, beside = slice(first, first + len(knot.new)), np.concatenate([knot.old, statics])
        back = policy.back[k, : len(knot.new)]
        of_others = np.concatenate([back[:, n : n + len(knot.old)], back[:, back.shape[1] - len(statics) :]], axis=1)
        step[rows], entry[rows], by_state[rows] = k, knot.new, back[:, :n]
        others[rows, : len(beside)], by_others[rows, : len(beside)] = beside, of_others
        first = rows.stop
    arrays = {"step": step, "knot": entry, "by_state": by_state, "others": others, "by_others": by_others}
    return {"z": motion.z, "states": motion.x, **arrays}


def follow(
    problem: StagedProblem, gains: Gains, x: Array, bounds: tuple[Array, Array], feedback: bool = True
) -> StagedMotion:
    """Simulate from a state x (nx,) at smoothing 0; without feedback the controls are the planned ones.

    ``bounds``: (len(z),) each, of z.
    """
    about, states, tick = gains["z"], gains["states"], gains["step"].astype(np.int64)
    z, found, inputs = about.copy(), [x], np.empty((problem.steps, problem.input_size))
    for k in range(problem.steps):
        for i in np.flatnonzero(tick == k) if feedback else ():
            beside = gains["others"][i].astype(np.int64)
            acting, knot = beside[beside >= 0], int(gains["knot"][i])
            off = problem.difference(states[k][None], found[-1][None])[0]
            moved = gains["by_state"][i] @ off + gains["by_others"][i, beside >= 0] @ (z - about)[acting]
            z[knot] = np.clip(about[knot] + moved, bounds[0][knot], bounds[1][knot])
        inputs[k] = (problem.weights[k * problem.input_size : (k + 1) * problem.input_size]) @ z
        found.append(problem.step(k, found[-1][None], inputs[k][None], z[None], 0.0)[0])
    return StagedMotion(z, np.array(found), inputs, 0.0)
