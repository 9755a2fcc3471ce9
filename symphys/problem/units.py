"""Units of the quantities that formulas name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from symphys.dynamics.observation import NamedSensor, named_sensors
from symphys.model.joints import AffineMotor, Joint, Servo, TorqueMotor, VelocityMotor
from symphys.model.world import World
from symphys.problem.model import ALIVE, Variable

UNITS = {
    "position": "m",
    "orientation": "",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "force": "N",
    "torque": "N m",
    "reaction_force": "N",
    "reaction_torque": "N m",
    "lag": "s",
    "delay": "s",
    "duration": "s",
    "mass": "kg",
    "radius": "m",
    "offset": "m",
    "gravity": "m/s^2",
    "friction": "",
    "restitution": "",
}
"""By the last part of a name, of what is no sensor (``SENSOR_KINDS``); world frame. A pure number has none."""
TURNING = {
    **dict.fromkeys(("motor", "lower", "upper", "spring", "torque"), "N m"),
    **{"lock": "N, then N m", "gain": "1/s", "velocity": "rad/s", "rest": "rad"},
    **{"stiffness": "N m/rad", "damping": "N m s/rad", "armature": "kg m^2", "friction": "N m"},
    **{"start": "rad", "start_rate": "rad/s"},
}
SLIDING = {
    **dict.fromkeys(("motor", "lower", "upper", "spring", "torque"), "N"),
    **{"lock": "N, then N m", "gain": "1/s", "velocity": "m/s", "rest": "m"},
    **{"stiffness": "N/m", "damping": "N s/m", "armature": "kg", "friction": "N"},
    **{"start": "m", "start_rate": "m/s"},
}
"""Of what belongs to joints, likewise."""


def quantity_unit(name: str, world: World) -> str | None:
    """Return the unit of a quantity by its name; None if it is unknown."""
    return _unit(name, world, named_sensors(world))


def _unit(name: str, world: World, sensors: Mapping[str, NamedSensor]) -> str | None:
    if name in sensors:
        return sensors[name].unit
    owner, _, key = name.rpartition(".")
    joint = next((joint for joint in world.joints if joint.name == owner), None)
    return UNITS.get(key) if joint is None else joint_unit(joint, key)


def joint_unit(joint: Joint, key: str) -> str | None:
    """Return the unit of a quantity of a joint; a command has the unit of what its motor follows."""
    units = {**(TURNING if joint.kind.turning else SLIDING), **joint.kind.units}
    if key == "gain" and isinstance(joint.motor, AffineMotor):  # force by command, which has any unit
        return None
    if key != "command":
        return units.get(key)
    followed = {Servo: "rest", VelocityMotor: "velocity", TorqueMotor: "torque"}
    return next((units[what] for kind, what in followed.items() if isinstance(joint.motor, kind)), None)


def formula_units(world: World, names: Iterable[str], variables: Iterable[Variable]) -> dict[str, str]:
    """The units of those of the names in formulas that are known; of a variable, that of all that it sets."""
    mixed = {joint.name for joint in world.joints if len({each.unit for each in joint.kind.coordinates}) > 1}
    sensors = named_sensors(world)
    known = {name: _unit(name, world, sensors) for name in names if name.rpartition(".")[0] not in mixed}
    for variable in variables:
        units = {_unit(slot.name, world, sensors) for slot in variable.slots}
        if variable.kind == "recording":
            units = {"" if slot.name.endswith(".scale") else "s" for slot in variable.slots}
        known[variable.name] = units.pop() if len(units) == 1 else None
    known = {"duration": "s"} | known | {"time": "s", ALIVE: ""}
    return {name: unit for name, unit in known.items() if unit is not None}
