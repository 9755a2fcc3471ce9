"""Sensors of bodies: where they are, how they move, how they are accelerated, what presses against them."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from symphys.dynamics.observation.sensor_kind import MjcfSensor, SensedState, SensorKind
from symphys.maths.rotation import matrix
from symphys.model.body import Body
from symphys.types import Expr


def _part(field: str) -> Callable[[SensedState, Body], Expr]:
    """Return a function that reads a field of a body off the state."""

    def read(at: SensedState, body: Body) -> Expr:
        return at.part(f"{body.name}.{field}")

    return read


def _gyro(at: SensedState, body: Body) -> Expr:
    """The angular velocity in the body's frame (3,) [rad/s]."""
    return ca.mtimes(_to_body(at, body), at.part(f"{body.name}.angular_velocity"))


def _to_body(at: SensedState, body: Body) -> Expr:
    """(3, 3): from the world's frame to the body's."""
    return matrix(at.part(f"{body.name}.orientation")).T


def _accelerometer(at: SensedState, body: Body) -> Expr:
    """The mean acceleration over the last step less gravity, in the body's frame (3,) [m/s^2]."""
    rate = (at.part(f"{body.name}.velocity") - at.before[f"{body.name}.velocity"]) / at.dt
    return ca.mtimes(_to_body(at, body), rate - ca.vertcat(*at.world.gravity))


def _contact_force(at: SensedState, body: Body) -> Expr:
    """The sum of the contact forces that last, world frame (3,) [N]; impacts, which take no time, are left out."""
    total = type(at.x).zeros(3)
    for pair in at.world.pairs:
        for side, sign in ((pair.first, 1), (pair.second, -1)):
            if side.body is not None and at.world.bodies[side.body].name == body.name:
                total += sign * at.part(f"{pair.name}.force")
    return total


BODY_SENSORS = (
    SensorKind(
        "position",
        "body",
        "of the centre of mass, world frame",
        _part("position"),
        unit="m",
        axes="world",
        mjcf=MjcfSensor("framepos", "body"),
    ),
    SensorKind(
        "orientation",
        "body",
        "unit quaternion w, x, y, z: from the body's frame into the world's",
        _part("orientation"),
        size=4,
        mjcf=MjcfSensor("framequat", "xbody"),
    ),
    SensorKind(
        "velocity",
        "body",
        "of the centre of mass, world frame",
        _part("velocity"),
        unit="m/s",
        axes="world",
        mjcf=MjcfSensor("framelinvel", "body"),
    ),
    SensorKind(
        "angular_velocity",
        "body",
        "world frame",
        _part("angular_velocity"),
        unit="rad/s",
        axes="world",
        mjcf=MjcfSensor("frameangvel", "xbody"),
    ),
    SensorKind(
        "gyro",
        "body",
        "the angular velocity in the body's frame",
        _gyro,
        unit="rad/s",
        axes="own",
        mjcf=MjcfSensor("gyro", "axes"),
    ),
    SensorKind(
        "accelerometer",
        "body",
        "in the body's frame: 9.81 upwards at rest, nothing in free fall",
        _accelerometer,
        unit="m/s^2",
        axes="own",
        before=lambda world, body: (f"{body.name}.velocity",),
        parameters=frozenset({"gravity"}),
        ahead=False,
        mjcf=MjcfSensor("accelerometer", "frame"),
    ),
    SensorKind(
        "contact_force",
        "body",
        "the sum of all contact forces on the body, world frame; impacts are left out",
        _contact_force,
        unit="N",
        axes="world",
    ),
)
"""Every kind of sensor of a body."""
