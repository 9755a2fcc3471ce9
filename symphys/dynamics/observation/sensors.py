"""Sensors of bodies and of sites, all kinds of sensors by name, and their values in a state."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.observation.joint_coordinates import JOINT_SENSORS
from symphys.dynamics.observation.sensor_kind import MjcfSensor, SensedState, SensorKind
from symphys.maths import rotation
from symphys.maths.rotation import matrix
from symphys.model.body import Body, Site
from symphys.model.world import World
from symphys.records import dataclass
from symphys.types import Expr


def _of_body(at: SensedState, site: Site, field: str) -> Expr:
    """Return a field of the body that carries the site."""
    assert site.body is not None
    return at.part(f"{at.world.bodies[site.body].name}.{field}")


def _place(at: SensedState, site: Site) -> Expr:
    """Return the site's position in the frame of what carries it (3,) [m]."""
    return type(at.x)(ca.vertcat(*site.position))


def _arm(at: SensedState, site: Site) -> Expr:
    """Return the vector from the centre of mass to the site, world frame (3,) [m]."""
    return rotation.rotate(_of_body(at, site, "orientation"), _place(at, site))


def _position(at: SensedState, site: Site) -> Expr:
    return _place(at, site) if site.body is None else _of_body(at, site, "position") + _arm(at, site)


def _orientation(at: SensedState, site: Site) -> Expr:
    turned = type(at.x)(ca.vertcat(*site.orientation))
    return turned if site.body is None else rotation.multiply(_of_body(at, site, "orientation"), turned)


def _velocity(at: SensedState, site: Site) -> Expr:
    if site.body is None:
        return type(at.x).zeros(3)
    return _of_body(at, site, "velocity") + ca.cross(_of_body(at, site, "angular_velocity"), _arm(at, site))


SITE_SENSORS = (
    SensorKind(
        "position",
        "site",
        "of the site, world frame",
        _position,
        unit="m",
        axes="world",
        mjcf=MjcfSensor("framepos", "site"),
    ),
    SensorKind(
        "orientation",
        "site",
        "unit quaternion w, x, y, z: from the site's axes into the world's",
        _orientation,
        size=4,
        mjcf=MjcfSensor("framequat", "site"),
    ),
    SensorKind(
        "velocity",
        "site",
        "of the site, world frame",
        _velocity,
        unit="m/s",
        axes="world",
        mjcf=MjcfSensor("framelinvel", "site"),
    ),
)
"""Every kind of sensor of a site."""


def _part(field: str) -> Callable[[SensedState, Body], Expr]:
    """Return a function that reads a field of a body off the state."""

    def read(at: SensedState, body: Body) -> Expr:
        return at.part(f"{body.name}.{field}")

    return read


def _gyro(at: SensedState, body: Body) -> Expr:
    """Return the angular velocity in the body's frame (3,) [rad/s]."""
    return ca.mtimes(_to_body(at, body), at.part(f"{body.name}.angular_velocity"))


def _to_body(at: SensedState, body: Body) -> Expr:
    """Return the from the world's frame to the body's (3, 3)."""
    return matrix(at.part(f"{body.name}.orientation")).T


def _accelerometer(at: SensedState, body: Body) -> Expr:
    """Return the mean acceleration over the last step less gravity, in the body's frame (3,) [m/s^2]."""
    rate = (at.part(f"{body.name}.velocity") - at.before[f"{body.name}.velocity"]) / at.dt
    return ca.mtimes(_to_body(at, body), rate - ca.vertcat(*at.world.gravity))


def _contact_force(at: SensedState, body: Body) -> Expr:
    """Return the sum of the contact forces that last, world frame (3,) [N].

    Impacts, which take no time, are left out.
    """
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
        "in the body's frame: 9.81 upwards at rest, zero in free fall",
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


SENSOR_KINDS: tuple[SensorKind, ...] = (*BODY_SENSORS, *JOINT_SENSORS, *SITE_SENSORS)
"""Every quantity of bodies, joints and sites that formulas read."""


@dataclass(frozen=True)
class NamedSensor:
    """A kind of sensor on a body, joint or site, which formulas call by the name of both: ``torso.gyro``."""

    kind: SensorKind
    owner: Any

    def read(self, at: SensedState) -> Expr:
        """Return its value (size,) in a state."""
        return self.kind.read(at, self.owner)

    def before(self, world: World) -> tuple[str, ...]:
        """Return the names of the parts of the state and of the inputs one step before that it needs."""
        return self.kind.before(world, self.owner)

    @property
    def unit(self) -> str:
        """Return the unit of its components."""
        return self.kind.unit_of(self.owner)


def named_sensors(world: World) -> dict[str, NamedSensor]:
    """Return every sensor of a world by the name that formulas use."""
    owners: dict[str, Sequence[Any]] = {"body": world.bodies, "joint": world.joints, "site": world.sites}
    return {
        f"{owner.name}.{kind.key}": NamedSensor(kind, owner)
        for kind in SENSOR_KINDS
        for owner in owners[kind.owner]
        if kind.has(owner)
    }


def sensor_readings(at: SensedState, wanted: Collection[str]) -> dict[str, Expr]:
    """Return what the wanted sensors read, by name.

    A sensor is left out where ``at.before`` lacks what it needs. Names that are none of a sensor are ignored.
    """
    found = dict[str, Expr]()
    for name, sensor in named_sensors(at.world).items():
        if name in wanted and all(part in at.before for part in sensor.before(at.world)):
            found[name] = sensor.read(at)
    return found
