"""Units of the quantities that formulas name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from symphys.dynamics.observation import NamedSensor, named_sensors
from symphys.model.joints import Joint
from symphys.model.joints.joint import joint_numbers
from symphys.model.numbers import Number
from symphys.model.shapes import SHAPES, Plane
from symphys.model.world import World
from symphys.problem.model import ALIVE, Variable
from symphys.problem.parametric.parts import COEFFICIENTS, INERTIAL
from symphys.problem.quantities import INPUT, START

OTHERS = {
    "reaction_force": "N",
    "reaction_torque": "N m",
    "lag": "s",
    "delay": "s",
    "duration": "s",
    "gravity": "m/s^2",
}
"""By the last part of a name, of what is neither a sensor (``SENSOR_KINDS``) nor declared."""
SIZES = {each.name: Number("m") for shape in SHAPES.values() for each in (*shape.size_keys, *shape.optional_keys)}
DECLARED = {**COEFFICIENTS, **INERTIAL, **SIZES, **Plane.numbers, **START, **INPUT}
"""What is declared of numbers of bodies, of static surfaces and of laws of contact."""
ALONG = {
    **dict.fromkeys(("motor", "lower", "upper", "spring"), "{torque}"),
    "anchor": "m",
    "start": "{angle}",
    "start_rate": "{angle}/s",
}
"""Units of what belongs to joints and is no number of theirs."""


def quantity_unit(name: str, world: World) -> str | None:
    """Return the unit of a quantity by its name; None if it is unknown."""
    return _unit(name, world, named_sensors(world))


def _unit(name: str, world: World, sensors: Mapping[str, NamedSensor]) -> str | None:
    if name in sensors:
        return sensors[name].unit
    owner, _, key = name.rpartition(".")
    joint = next((joint for joint in world.joints if joint.name == owner), None)
    if joint is not None:
        return joint_unit(joint, key)
    return DECLARED[key].unit if key in DECLARED else OTHERS.get(key)


def joint_unit(joint: Joint, key: str) -> str | None:
    """Return the unit of a quantity of a joint; a command has the unit of what its motor follows."""
    if key == "lock":
        return "N, then N m"
    known = joint_numbers(joint.kind, joint.motor, joint.spring)
    if key == "command" and joint.motor is not None:
        return joint.motor.command.along(joint.kind.turning).unit
    return known[key].unit if key in known else Number(ALONG.get(key)).along(joint.kind.turning).unit


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
