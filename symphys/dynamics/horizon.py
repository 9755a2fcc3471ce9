"""Many steps: a horizon as one casadi call, without Python in the time loop."""

from __future__ import annotations

from typing import Any

import casadi as ca

from symphys.types import Expr


def roll_out(step: ca.Function, steps: int, x0: Expr, u: Expr, p: Expr, smoothing: Expr) -> tuple[Expr, ...]:
    """``steps`` steps from x0; the inputs change with each, parameters and smoothing do not.

    Args:
        step: a function (x, u, p, smoothing) -> (x_next, ...).
        steps: how many, N.
        x0: (nx,) the state at t = 0.
        u: (nu, N) inputs of each step.
        p: (np,) parameters.
        smoothing: scalar [m/s].

    Returns:
        The states (nx, N + 1) that include x0, then each further output of ``step``, N columns of them.

    Example:
        >>> from symphys import step_function
        >>> from symphys.dynamics.horizon import roll_out
        >>> from symphys.model import Body, Layout, Plane, initial_state, make_world
        >>> world = make_world([Body.ball("ball", radius=0.1, mass=0.5, position=(0, 0, 1))], [Plane.ground()])
        >>> (x,) = roll_out(step_function(world), 100, initial_state(world), [], [], 0)
        >>> x[Layout(world)["ball.position"], :].shape  # expressions, in any casadi problem
        (3, 101)
    """
    whole = {"base": -1}  # all steps side by side: nested groups of steps take longer to build and to differentiate
    horizon = step.mapaccum(f"{step.name()}_{steps}", steps, whole)
    outputs: Any = horizon(x0, u, ca.repmat(p, 1, steps), ca.repmat(ca.MX(smoothing), 1, steps))
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    return (ca.horzcat(x0, outputs[0]), *outputs[1:])
