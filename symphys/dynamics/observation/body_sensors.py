"""What can be felt on a body: how it turns, how it is accelerated, what presses against it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from symphys.maths.rotation import matrix
from symphys.model.state_layout import Layout
from symphys.model.world import World
from symphys.types import Expr

BODY_QUANTITIES = ("gyro", "contact_force")


def body_quantities(world: World, x: Expr) -> dict[str, Expr]:
    """What formulas call them, each (3,).

    ``torso.gyro``: angular velocity in the body's frame [rad/s]. ``foot.contact_force``: the sum of the contact forces
    on the body that last, world frame [N]; impacts, which take no time, are not among them.
    """
    layout, zero = Layout(world), type(x).zeros(3)
    named: dict[str, Expr] = {f"{body.name}.contact_force": zero for body in world.bodies}
    for body in world.bodies:
        turned = matrix(x[layout[f"{body.name}.orientation"]]).T
        named[f"{body.name}.gyro"] = ca.mtimes(turned, x[layout[f"{body.name}.angular_velocity"]])
    for pair in world.pairs:
        force = x[layout[f"{pair.name}.force"]]
        for side, sign in ((pair.first, 1), (pair.second, -1)):
            if side.body is not None:
                named[f"{world.bodies[side.body].name}.contact_force"] += sign * force
    return named


def accelerometers(world: World, x: Expr, before: Mapping[str, Expr], dt: Expr) -> dict[str, Expr]:
    """``torso.accelerometer`` (3,): what a sensor at the centre of mass reads, in the body's frame [m/s^2].

    The mean acceleration over the last step less gravity: at rest it reads 9.81 upwards, in free fall nothing.

    Args:
        world: what is simulated.
        x: the state.
        before: by body, its velocity one step before (3,).
        dt: [s].
    """
    layout, gravity = Layout(world), ca.vertcat(*world.gravity)
    named = {}
    for body, velocity in before.items():
        turned = matrix(x[layout[f"{body}.orientation"]]).T
        rate = (x[layout[f"{body}.velocity"]] - velocity) / dt
        named[f"{body}.accelerometer"] = ca.mtimes(turned, rate - gravity)
    return named


def body_quantity_names(world: World) -> list[str]:
    """The names of ``body_quantities``."""
    return [f"{body.name}.{field}" for body in world.bodies for field in BODY_QUANTITIES]


def accelerometer_bodies(world: World, names: Sequence[str] | frozenset[str]) -> tuple[str, ...]:
    """The bodies whose accelerometer is among these names."""
    return tuple(body.name for body in world.bodies if f"{body.name}.accelerometer" in names)
