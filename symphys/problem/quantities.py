"""The quantities that variables set and formulas read, with their values in the file and their units."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from math import inf

import numpy as np

from symphys.dynamics.observation import NamedSensor, named_sensors
from symphys.model.joints import Joint
from symphys.model.joints.joint import joint_numbers
from symphys.model.numbers import Number
from symphys.model.shapes import SHAPES, Plane
from symphys.model.state_layout import input_sizes
from symphys.model.world import COMBINE, World
from symphys.problem.model import ALIVE, DURATION, FeedbackController, Kind, ProblemData, Variable, VariableSlot
from symphys.problem.parametric.joints import OWN
from symphys.problem.parametric.parts import COEFFICIENTS, INERTIAL
from symphys.problem.parametric.world import CONTACT, ParametricWorld
from symphys.problem.references import DELAY, ReferenceTrajectory
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.types import Array

SLOT = re.compile(r"\s*([^\[\]\s]+)\s*(?:\[\s*(-?\d{1,9})?\s*(:)?\s*(-?\d{1,9})?\s*\])?\s*")
EDGE = "edge"
MAX_EDGE_SHARE = 0.99
"""Of half of a box's smallest edge: the largest radius of its edges, unless ``upper`` says otherwise."""
MIN_SHARE = 1e-3
"""What must exceed its least value stays above this share of its value in the file, unless ``lower`` is less."""
START_NUMBERS: Mapping[str, Number] = {
    "position": Number("m", scale=1.0),
    "orientation": Number("", scale=1.0),
    "velocity": Number("m/s", scale=1.0),
    "angular_velocity": Number("rad/s", scale=1.0),
}
"""Numbers of a body at the start."""
INPUT_NUMBERS: Mapping[str, Number] = {"force": Number("N", scale=1.0), "torque": Number("N m", scale=1.0)}
"""Inputs of a body."""
COMMAND_NUMBER = Number(None, scale=1.0)
"""The command of a motor; motors say more of it."""
WEIGHT_NUMBER = Number("", scale=0.1)
"""A number of a controller."""
FORCE_NUMBER = Number(None)
"""A number of a force law."""
DELAY_NUMBER = Number("s", scale=0.01)
DURATION_NUMBER = Number("s", least=0.0, exceeds=True)
CLOCK_NUMBERS: Mapping[str, Number] = {"offset": Number("s", scale=0.01), "scale": Number("", least=0.0)}
"""Numbers of the clock of a recording."""
OTHER_UNITS = {
    "reaction_force": "N",
    "reaction_torque": "N m",
    "lag": "s",
    "delay": "s",
    "duration": "s",
    "gravity": "m/s^2",
}
"""By the last part of a name, of what is neither a sensor (``SENSOR_KINDS``) nor declared."""
SIZES = {each.name: Number("m") for shape in SHAPES.values() for each in (*shape.size_keys, *shape.optional_keys)}
DECLARED = {**COEFFICIENTS, **INERTIAL, **SIZES, **Plane.numbers, **START_NUMBERS, **INPUT_NUMBERS}
"""What is declared of numbers of bodies, of static surfaces and of laws of contact."""
JOINT_UNITS = {
    **dict.fromkeys(("motor", "lower", "upper", "spring"), "{torque}"),
    "anchor": "m",
    "start": "{angle}",
    "start_rate": "{angle}/s",
}
"""Units of what belongs to joints and is no number of theirs."""


class SlotError(ValueError):
    """A text that names nothing a variable can set."""


@dataclass(frozen=True)
class Quantity:
    """A quantity that a variable can set: (components,) as the file has it, and its declaration."""

    kind: Kind
    nominal: Array
    number: Number


def quantities(
    parametric: ParametricWorld, initial: Mapping[str, Array], inputs: Mapping[str, int]
) -> dict[str, Quantity]:
    """Return the quantities of a world by name: states at the start, inputs with their sizes, then parameters."""
    found = {name: Quantity("initial", value, START_NUMBERS[last_part(name)]) for name, value in initial.items()}
    found |= {
        name: Quantity("control", np.zeros(size), INPUT_NUMBERS.get(last_part(name), COMMAND_NUMBER))
        for name, size in inputs.items()
    }
    return found | {
        name: Quantity("parameter", value, parametric.numbers[name]) for name, value in parametric.parameters().items()
    }


def last_part(name: str) -> str:
    """The key of a name: ``velocity`` of ``ball.velocity``."""
    return name.rpartition(".")[2]


def start_quantities(parametric: ParametricWorld) -> dict[str, Quantity]:
    """Coordinates of joints at the start, within the limits of the joints, and their rates."""
    found, values = dict[str, Quantity](), parametric.starts()
    for joint in parametric.joints:
        name, low, high = f"{joint.name}.start", joint.limits.lower, joint.limits.upper
        if name in values:
            least, most = -inf if low is None else low, inf if high is None else high
            numbers = Number("{angle}", least, most, scale=1.0), Number("{angle}/s", scale=1.0)
            for key, each in zip((name, f"{name}_rate"), numbers, strict=True):
                found[key] = Quantity("initial", values[key], each.along(joint.kind.turning))
    return found


def duration_quantity(duration: float) -> dict[str, Quantity]:
    """Return the duration of the motion [s] as a quantity."""
    return {DURATION: Quantity("duration", np.array([duration]), DURATION_NUMBER)}


def weight_quantities(controllers: Iterable[FeedbackController]) -> dict[str, Quantity]:
    """The numbers of controllers by name, such as ``brain.weights``."""
    return {
        name: Quantity("weight", value, WEIGHT_NUMBER)
        for controller in controllers
        for name, value in controller.weights.items()
    }


def recording_quantities(names: Iterable[str], delays: Iterable[tuple[str, float]]) -> dict[str, Quantity]:
    """Return the time offset [s] and the scale of each [[recording]], and the delays of inputs [s]."""
    found = dict[str, Quantity]()
    for name in names:
        found[f"{name}.offset"] = Quantity("recording", np.zeros(1), CLOCK_NUMBERS["offset"])
        found[f"{name}.scale"] = Quantity("recording", np.ones(1), CLOCK_NUMBERS["scale"])
    for name, delay in delays:
        found[f"{name}.{DELAY}"] = Quantity("recording", np.array([delay]), DELAY_NUMBER)
    return found


def delay_quantities(references: Iterable[ReferenceTrajectory]) -> dict[str, Quantity]:
    """The delays of references by name, such as ``walk.delay`` [s]."""
    return {
        name: Quantity("weight", value, DELAY_NUMBER) for each in references for name, value in each.weights.items()
    }


def read_slot(text: str, known: Mapping[str, Quantity]) -> VariableSlot:
    """The slot that ``ball.force[0:2]`` means; SlotError says why it means none."""
    match = SLOT.fullmatch(text)
    if not match:
        raise SlotError(f'{quote(text)} is no quantity; write "ball.velocity", "ball.force[0:2]" or "ball.position[2]"')
    name, start, colon, stop = match.groups()
    if name not in known:
        raise SlotError(f"there is no quantity {quote(name)}; {unknown(name, known)}")
    count = len(known[name].nominal)
    if start is None and stop is None and colon is None:
        if "[" in text:
            raise SlotError(f"{quote(text)} has an empty index")
        return VariableSlot(name, tuple(range(count)))
    for end in (start, stop):
        if end is not None and not -count <= int(end) <= count - (colon is None):
            raise SlotError(f"{quote(text)} reaches beyond {name}, which has {count} components, 0 to {count - 1}")
    indices = range(count)
    if colon is None:
        return VariableSlot(name, (indices[int(start or 0)],))
    chosen = indices[slice(int(start) if start else None, int(stop) if stop else None)]
    if not chosen:
        raise SlotError(f"{quote(text)} is an empty range")
    return VariableSlot(name, tuple(chosen))


def unknown(name: str, known: Collection[str]) -> str:
    """The nearest quantities; for a coefficient that no table states, how to state it."""
    owner, _, key = name.rpartition(".")
    owners = dict.fromkeys(other.rpartition(".")[0] for other in known)
    of_contact = key in COEFFICIENTS and (key in COMBINE or owner == CONTACT or "-" in owner)
    if owner in owners and (of_contact or key in OWN or (f"{owner}.size" in known and key == EDGE)):
        above = (key in COEFFICIENTS and COEFFICIENTS[key].structural) or key == EDGE or f"{owner}.anchor" in known
        what = "a value above 0" if above else "a value"
        return f"{owner} states no {key}: give it {what} there first, so that this variable has something to change"
    same_owner = [other for other in known if owner and other.startswith(f"{owner}.")]
    tables = "" if key in COMBINE else ": [contact] and [[pair]] may state it"
    stated = f"; what states no {key} has none to vary{tables}" if key in COEFFICIENTS else ""
    if key == DELAY:
        stated += "; a [[reference]] must state its delay, 0 too, for a variable to set it; of what a [[recording]] "
        stated += "drives by its inputs it is knee.command.delay"
    return hint(name, same_owner or known) + stated


def set_quantities(problem: ProblemData, variable: Variable) -> str:
    """Describe what a variable sets as a file writes it; quantities of a list get the same values."""
    values = {**problem.initial, **problem.parametric.starts(), **problem.parameters, **problem.weights}
    tables = sorted({recording.table for recording in problem.recordings})
    delays = {name: each.delay for recording in problem.recordings for name, each in recording.inputs.items()}
    values |= {name: each.nominal for name, each in recording_quantities(tables, delays.items()).items()}
    sizes = {DURATION: 1, **{name: value.size for name, value in values.items()}, **input_sizes(problem.world())}

    def text(slot: VariableSlot) -> str:
        first, count = slot.components[0], len(slot.components)
        if count == sizes[slot.name]:
            return slot.name
        return f"{slot.name}[{first}]" if count == 1 else f"{slot.name}[{first}:{first + count}]"

    *others, last = map(text, variable.slots)
    return f"{', '.join(others)} and {last} to the same values" if others else last


def limits(slot: VariableSlot, known: Mapping[str, Quantity]) -> tuple[Array, Array]:
    """(components,) twice: the bounds that hold where the file states none."""
    quantity = known[slot.name]
    low, high = (np.full(len(slot.components), limit) for limit in (quantity.number.least, quantity.number.most))
    if quantity.number.exceeds or quantity.number.floored:
        low = MIN_SHARE * quantity.nominal[list(slot.components)]
    owner, _, key = slot.name.rpartition(".")
    if key == EDGE and quantity.kind == "parameter":
        high = np.full(1, MAX_EDGE_SHARE * known[f"{owner}.size"].nominal.min() / 2)
    return low, high


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
    return DECLARED[key].unit if key in DECLARED else OTHER_UNITS.get(key)


def joint_unit(joint: Joint, key: str) -> str | None:
    """Return the unit of a quantity of a joint; a command has the unit of what its motor follows."""
    if key == "lock":
        return "N, then N m"
    known = joint_numbers(joint.kind, joint.motor, joint.spring)
    if key == "command" and joint.motor is not None:
        return joint.motor.command.along(joint.kind.turning).unit
    return known[key].unit if key in known else Number(JOINT_UNITS.get(key)).along(joint.kind.turning).unit


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
