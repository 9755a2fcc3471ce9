"""Derivatives of one step as casadi functions for other programs: along one direction, and as matrices."""

from __future__ import annotations

import casadi as ca

from symphys.transcription.rollout import call
from symphys.transcription.staged.step_program import StepArguments

ARGUMENTS = ["x", "u", "p", "smoothing"]


def directional_slope(arguments: StepArguments) -> ca.Function:
    """Return the function (x, u, p, smoothing, dx, du, dp) -> (x_next (nx,), dx_next (n,)), all of it dense.

    dx (n,) is a tangent of x, and dx_next one of the next state; ``Tangent`` defines their coordinates. If there are
    controllers, the last entry of u is the time [s], which du does not have.
    """
    tangent, closed = arguments.tangent, arguments.rollout.closed
    x, u, p, smoothing = (ca.SX.sym(name, closed.size1_in(i)) for i, name in enumerate(ARGUMENTS))
    n, m, np_ = arguments.sizes[1:]
    dx, du, dp = ca.SX.sym("dx", n), ca.SX.sym("du", m), ca.SX.sym("dp", np_)
    after, *others = call(closed, x, u, p, smoothing)
    moved = ca.mtimes(tangent.basis(x, p), dx) + ca.mtimes(tangent.shift(x, p), dp)
    seeds = [moved, ca.vertcat(du, ca.SX.zeros(u.numel() - m)), dp, ca.SX.zeros(1)]
    pushed = closed.forward(1)(x, u, p, smoothing, after, *others, *seeds)
    pushed = pushed[0] if isinstance(pushed, tuple | list) else pushed
    off = ca.mtimes(tangent.projection(after, p), pushed - ca.mtimes(tangent.shift(after, p), dp))
    results = [ca.densify(each) for each in (after, off)]
    names = [*ARGUMENTS, "dx", "du", "dp"]
    return ca.Function("directional", [x, u, p, smoothing, dx, du, dp], results, names, ["x_next", "dx_next"])


def slopes_function(arguments: StepArguments) -> ca.Function:
    """Return the function (x, u, p, smoothing) -> (x_next (nx,), A (n, n), B (n, m), C (n, np)), in tangents."""
    one = directional_slope(arguments)
    x, u, p, smoothing = (ca.MX.sym(name, one.size1_in(i)) for i, name in enumerate(ARGUMENTS))
    n, m, np_ = arguments.sizes[1:]
    count = n + m + np_
    directions = ca.DM.eye(count)
    seeds = [directions[rows, :] for rows in (slice(n), slice(n, n + m), slice(n + m, count))]
    after, slopes = one.map(count)(*(ca.repmat(each, 1, count) for each in (x, u, p, smoothing)), *seeds)
    parts = ca.horzsplit(slopes, [0, n, n + m, count])
    return ca.Function("linearize", [x, u, p, smoothing], [after[:, 0], *parts], ARGUMENTS, ["x_next", "A", "B", "C"])
