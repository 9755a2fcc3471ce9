"""All kinds of sensors, and what they read in a state."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

from symphys.dynamics.observation.body_sensors import BODY_SENSORS
from symphys.dynamics.observation.joint_coordinates import JOINT_SENSORS
from symphys.dynamics.observation.sensor_kind import SensedState, SensorKind
from symphys.dynamics.observation.sites import SITE_SENSORS
from symphys.model.world import World
from symphys.types import Expr

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
        """The unit of its components."""
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
