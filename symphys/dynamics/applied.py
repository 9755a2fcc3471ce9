"""What inputs exert on a body: its own force and torque, and motors at its sites."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

import casadi as ca

from symphys.dynamics.arguments import arguments_of, context_of, inline, parts_of
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.tracing.decorator import traced, tracing
from symphys.maths import rotation
from symphys.maths.smoothing import at_least, at_most
from symphys.model.body import Site
from symphys.model.state_layout import INPUT_FIELDS, Layout
from symphys.model.world import Scheme, World
from symphys.types import Expr

Wrench = tuple[Expr, Expr]
"""Force (3,) [N] and torque about the centre of mass (3,) [N m], world frame."""


def applied_wrench(context: StepContext, x: State, index: int, duration: Expr) -> Wrench:
    """Return what inputs exert on a body in a substep [s]: constant there, motors as the body lies in its middle."""
    body, zero = context.world.bodies[index], ca.SX.zeros(3)
    given = (context.input(f"{body.name}.{field}") for field in INPUT_FIELDS)
    force, torque = (zero if each is None else each for each in given)
    for site in context.world.sites:
        command = None if site.motor is None or site.body != index else context.input(f"{site.name}.command")
        if command is not None:
            turning = x[f"{body.name}.orientation"], x[f"{body.name}.angular_velocity"]
            force, torque = _with_motor((force, torque), site, turning, command, context.settings.smoothing, duration)
    return force, torque


def applied_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """Return what inputs exert on all bodies in a step: (x, u, p) -> forces, torques; (3 B,) each."""
    arguments = arguments_of(world, inputs, parameters)
    tracer, x = inline(world, arguments), parts_of(Layout(world), arguments[0])
    with tracing(tracer):
        context = context_of(world, scheme, inputs, arguments)
        dt = ca.SX(context.settings.scheme.dt)
        found = [applied_wrench(context, x, index, dt) for index in range(len(world.bodies))]
    forces, torques = (ca.vertcat(*(tracer.value(each[k]) for each in found)) for k in (0, 1))
    results = [ca.substitute(each, arguments[3], 0) for each in (forces, torques)]
    return ca.Function("applied", arguments[:3], [ca.densify(each) for each in results])


@traced
def _with_motor(
    others: Wrench, site: Site, turning: tuple[Expr, Expr], command: Expr, smoothing: Expr, duration: Expr
) -> Wrench:
    motor, (orientation, spin) = site.motor, turning
    assert motor is not None
    for end, held in zip(motor.command_range or (), (at_least, at_most), strict=False):
        command = held(command, end, smoothing) if isfinite(end) else command
    # in the body's frame, then as it lies in the middle of the substep
    axes, arm = rotation.matrix(ca.vertcat(*site.orientation)), ca.vertcat(*site.position)
    force, torque = (command * ca.mtimes(axes, ca.vertcat(*each)) for each in (motor.force, motor.torque))
    middle = rotation.matrix(rotation.turn(orientation, duration / 2 * spin))
    return others[0] + ca.mtimes(middle, force), others[1] + ca.mtimes(middle, torque + ca.cross(arm, force))
