"""The [[sensor]], [[controller]] and [[force]] tables: what acts on inputs, and what it reads of the state."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from symphys.archives import ArchiveError, OtherShape, read_array
from symphys.dynamics.observation import SENSOR_KINDS
from symphys.expression import Formula, FormulaError, parse
from symphys.files import check_regular
from symphys.model.controllers import CONTROLLERS, ControlLaw, Custom, Net
from symphys.problem.limits import check_net
from symphys.problem.model import FeedbackController, ForceLaw, Phase, Sensor, Variable, VariableSlot
from symphys.problem.quantities import FORCE_NUMBER, Quantity, SlotError, read_slot
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.reading.messages import wanted
from symphys.problem.schema.control import ControllerTable, ForceTable, NetTable, SensorTable
from symphys.problem.tables.simulation import find_phase
from symphys.suggest import hint, quote
from symphys.types import Array

LAWS = {
    **{word: f"{word} = {law.example}" for word, law in CONTROLLERS.items()},
    "net": "net = { hidden = [32, 32] }",
    "function": "function = {}",
}
UNKNOWN_AHEAD = tuple(f".{kind.key}" for kind in SENSOR_KINDS if not kind.ahead)
"""Ends of the names of what is not known half a step ahead."""
CONSTANT_KINDS = ("parameter", "weight")
"""Kinds of variables that have one value over the whole motion, which a law may name."""


def read_sensors(tables: Sequence[SensorTable], sample: Mapping[str, Any], faults: Faults) -> tuple[Sensor, ...]:
    """Read the sensors; ``sample`` has a value for each name that a sensor may read."""
    return tuple(_read_sensor(index, table, sample, faults) for index, table in enumerate(tables))


def _read_sensor(index: int, table: SensorTable, sample: Mapping[str, Any], faults: Faults) -> Sensor:
    formulas: list[Formula] = []
    size = 0
    for text in table.reads:
        try:
            formula = parse(text)
            value = ca.DM(formula.evaluate(sample))
        except FormulaError as error:
            faults.add(("sensor", index, "reads"), str(error))
            continue
        if not value.is_regular():
            faults.add(("sensor", index, "reads"), f"{text} is not a finite number at the start of the guess")
        formulas.append(formula)
        size += int(value.shape[0])
    return Sensor(table.name, tuple(formulas), size)


def read_controllers(
    tables: Sequence[ControllerTable],
    sensors: Sequence[Sensor],
    known: Mapping[str, Quantity],
    functions: Mapping[str, ca.Function],
    faults: Faults,
    varied: Collection[str] = (),
) -> tuple[FeedbackController, ...]:
    """Read the controllers; those that are unclear are left out.

    Args:
        tables: as they are in the file.
        sensors: that they may use.
        known: every quantity; those of kind "control" can be driven.
        functions: by name, those that Python gives.
        faults: gets what is wrong.
        varied: names of quantities that variables set.
    """
    widths = {sensor.name: sensor.size for sensor in sensors}
    readers = [
        ControllerReader(index, table, widths, known, functions, faults, varied) for index, table in enumerate(tables)
    ]
    found = [reader.read() for reader in readers]
    for name in functions.keys() - {table.name for table in tables if table.function is not None}:
        faults.add(("controller",), f'Python gives a function {quote(name)}, but no controller "{name}" has function')
    return tuple(controller for controller in found if controller)


class ControllerReader:
    """Reads one table; every fault is noted below its place."""

    def __init__(
        self,
        index: int,
        table: ControllerTable,
        widths: Mapping[str, int],
        known: Mapping[str, Quantity],
        functions: Mapping[str, ca.Function],
        faults: Faults,
        varied: Collection[str] = (),
    ) -> None:
        """Keep what all steps need."""
        self.place: Place = ("controller", index)
        self.table, self.widths, self.known, self.functions, self.faults = table, widths, known, functions, faults
        self.varied = f"{table.name}.weights" in varied

    def add(self, key: str, message: str) -> None:
        """Note a fault of one key, or of a key of a table within."""
        self.faults.add((*self.place, *key.split(".")), message)

    def read(self) -> FeedbackController | None:
        """The controller; None if it is unclear what it is."""
        before = len(self.faults.issues)
        drives, senses = self.drives(), self.senses()
        kind = self.kind()
        if len(self.faults.issues) > before or kind is None:
            return None
        law = self.law(kind, senses, len(drives))
        if law is None:
            return None
        numbers = {key: self.numbers(kind, key, size, law) for key, size in law.sizes.items()}
        scale = self.spread_out("scale", self.table.scale, len(drives))
        return FeedbackController(self.table.name, law, tuple(self.table.senses), drives, scale, numbers)

    def drives(self) -> tuple[tuple[str, int], ...]:
        """Return the driven inputs and their components."""
        found: list[tuple[str, int]] = []
        inputs = {name: quantity for name, quantity in self.known.items() if quantity.kind == "control"}
        for text in self.table.drives:
            try:
                slot = read_slot(text, inputs)
            except SlotError as error:
                self.add("drives", f"{error}; what can be driven are forces, torques and commands of motors")
                continue
            found += [(slot.name, component) for component in slot.components]
        if len(set(found)) < len(found):
            self.add("drives", "names the same input twice")
        return tuple(found)

    def senses(self) -> int:
        """Return how many numbers the sensors read."""
        total = 0
        for name in self.table.senses:
            if name not in self.widths:
                near = hint(name, self.widths) if self.widths else "there is none; add a [[sensor]]"
                self.add("senses", f"no sensor is called {quote(name)}; {near}")
            total += self.widths.get(name, 0)
        return total

    def kind(self) -> str | None:
        """The one that is given."""
        given = [name for name in LAWS if getattr(self.table, name) is not None]
        if len(given) == 1:
            return given[0]
        self.faults.add(self.place, f"{wanted(given)} one of {', '.join(LAWS.values())}")
        return None

    def law(self, kind: str, senses: int, outputs: int) -> ControlLaw | None:
        """Read the law of a controller; None after a fault."""
        table = self.table
        if kind == "function":
            return self.function(senses, outputs)
        blind = kind in CONTROLLERS and CONTROLLERS[kind].blind
        if blind and senses:
            self.add("senses", f"a {kind} controller senses nothing; leave this out, or add another controller")
        if not blind and not senses:
            self.add("senses", f"a {kind} controller needs what it senses: names of sensors")
            return None
        if table.net is None:
            declared, given = CONTROLLERS[kind], getattr(table, kind)
            keys = {each.name: getattr(given, each.name) for each in fields(declared) if "value" in each.metadata}
            return declared(**keys, outputs=outputs, senses=0 if blind else senses)
        net = table.net
        law = Net(senses, outputs, tuple(net.hidden), net.activation, net.output, net.biases, net.skip)
        fits = check_net((*self.place, "net", "hidden"), law.sizes["weights"], self.varied, self.faults)
        return law if fits else None

    def function(self, senses: int, outputs: int) -> ControlLaw | None:
        """The function that Python gives, if its sizes fit."""
        given = self.functions.get(self.table.name)
        if given is None:
            text = f"comes from Python: load_problem(file, functions={{{quote(self.table.name)}: function}})"
            self.add("function", f"{text}; the command line knows none")
            return None
        if given.n_in() != 3 or given.n_out() != 1:
            self.add("function", f"takes {given.n_in()} arguments; it must be one of (sensed, time, weights)")
            return None
        for what, has, needs in (
            ("arguments for what is sensed", given.numel_in(0), senses),
            ("arguments for the time", given.numel_in(1), 1),
            ("outputs", given.numel_out(0), outputs),
        ):
            if has != needs:
                self.add("function", f"has {has} {what}; {needs} are needed")
                return None
        return Custom(given)

    def numbers(self, kind: str, key: str, size: int, law: ControlLaw) -> Array:
        """(size,) the law's numbers at the start."""
        table = getattr(self.table, kind)
        if isinstance(table, NetTable) and isinstance(law, Net):
            if table.weights is None:
                return random_weights(law, table.spread, table.seed)
            return read_weights(self.faults, (*self.place, "net", "weights"), table.weights, law)
        return self.spread_out(f"{kind}.{key}", getattr(table, key, None) or 0.0, size)

    def spread_out(self, key: str, value: object, size: int) -> Array:
        """(size,): a number for all, or one for each."""
        array = np.array(value, float) if regular(value) else np.zeros((0, 0))
        if array.ndim and array.size != size:
            self.add(key, f"must be a number, or {size} of them; it has {array.size}")
            return np.zeros(size)
        return np.broadcast_to(array.ravel() if array.ndim else array, (size,)).copy()


def regular(value: Any) -> bool:
    """Whether lists of lists are equally long."""
    return not isinstance(value, list) or len({len(row) if isinstance(row, list) else 0 for row in value}) == 1


def random_weights(net: Net, spread: float, seed: int) -> Array:
    """(w,) normally distributed, with a standard deviation of spread / sqrt(inputs of the layer); biases are 0."""
    rng = np.random.default_rng(seed)
    weights = np.zeros(net.sizes["weights"])
    for layer in net.layers():
        count = layer.matrix.stop - layer.matrix.start
        weights[layer.matrix] = spread / np.sqrt(layer.inputs) * rng.standard_normal(count)
    straight = weights[net.straight]
    straight[:] = spread / np.sqrt(net.senses) * rng.standard_normal(straight.size)
    return weights


def read_weights(faults: Faults, place: Place, name: str, net: Net) -> Array:
    """(w,) from a .npy file, whose path is relative to the file that names it; zeros after a fault."""
    path = Path(faults.origin(place).file).parent / name
    count = net.sizes["weights"]
    try:
        check_regular(path)
        with path.open("rb") as file:
            array = read_array(file, (count,))
    except OSError as error:
        faults.add(place, f"{path} cannot be read: {error.strerror or error}")
        return np.zeros(count)
    except OtherShape as error:
        layers = ", ".join(f"{layer.outputs} x {layer.inputs}" for layer in net.layers())
        text = f"has the shape {error}; the net has {count} weights, so ({count},) is needed: matrices {layers}"
        faults.add(place, f"{path} {text}{' with biases' if net.biases else ''}")
        return np.zeros(count)
    except ArchiveError:
        faults.add(place, f"{path} cannot be read: it is no .npy file of numbers")
        return np.zeros(count)
    if array.dtype.kind not in "fiu":
        faults.add(place, f"{path} does not hold one array of numbers")
    elif not np.isfinite(array).all():
        k = int(np.argmax(~np.isfinite(array)))
        faults.add(place, f"{path} holds numbers that are not finite; the first is number {k}")
    else:
        return array.astype(float)
    return np.zeros(count)


def force_quantities(tables: Sequence[ForceTable]) -> dict[str, Quantity]:
    """The numbers of all force laws by the names that variables and formulas use, such as ``drag.c``."""
    return {
        f"{table.name}.{key}": Quantity("weight", np.ravel(np.array(value, float)), FORCE_NUMBER)
        for table in tables
        for key, value in table.numbers.items()
    }


def read_forces(
    tables: Sequence[ForceTable],
    known: Mapping[str, Quantity],
    sample: Mapping[str, Any],
    variables: Sequence[Variable],
    phases: Mapping[str, Phase],
    faults: Faults,
) -> tuple[ForceLaw, ...]:
    """Read the force laws; those that are unclear are left out.

    Args:
        tables: as they are in the file.
        known: every quantity; those of kind "control" can be added to.
        sample: a value for each name in formulas, as the guess has it.
        variables: of the problem.
        phases: by name.
        faults: gets what is wrong.
    """
    found = [_read_force(index, table, known, sample, variables, phases, faults) for index, table in enumerate(tables)]
    return tuple(law for law in found if law is not None)


def _read_force(
    index: int,
    table: ForceTable,
    known: Mapping[str, Quantity],
    sample: Mapping[str, Any],
    variables: Sequence[Variable],
    phases: Mapping[str, Phase],
    faults: Faults,
) -> ForceLaw | None:
    place = ("force", index)
    slot = _slot("on", table.on, known, place, faults)
    against = None if table.against is None else _slot("against", table.against, known, place, faults)
    if slot is None or (against is None and table.against is not None):
        return None
    if against is not None:
        fields = {part.name.rpartition(".")[2] for part in (slot, against)}
        if len(fields) > 1 or len(slot.components) != len(against.components) or slot == against:
            faults.add((*place, "against"), f"must be as {table.on}, but of another body or motor")
    try:
        formula = parse(table.value)
        value = ca.DM(formula.evaluate(sample))
    except FormulaError as error:
        faults.add((*place, "value"), str(error))
        return None
    kinds = {variable.name: variable.kind for variable in variables}
    for name in sorted(formula.names):
        if kinds.get(name, CONSTANT_KINDS[0]) not in CONSTANT_KINDS:
            instead = " or ".join(slot.name for v in variables if v.name == name for slot in v.slots)
            faults.add((*place, "value"), f"the variable {quote(name)} sets {instead}; name that instead")
        if name.endswith(UNKNOWN_AHEAD):
            faults.add((*place, "value"), f"{quote(name)} is not known while the force is; take velocities")
    size = int(value.shape[0])
    if size != len(slot.components):
        parts = f"has {len(slot.components)} component{'s' * (len(slot.components) > 1)}"
        faults.add((*place, "value"), f"has {size} component{'s' * (size > 1)}, but {table.on} {parts}")
    elif not value.is_regular():
        faults.add((*place, "value"), "is not a finite number at the start of the guess")
    numbers = {key: known[f"{table.name}.{key}"].nominal for key in table.numbers}
    opposite = None if against is None else (against.name, against.components)
    phase = None if table.during is None else find_phase(table.during, phases, (*place, "during"), faults)
    during = None if phase is None else (phase.start, phase.end)
    return ForceLaw(table.name, slot.name, slot.components, formula, numbers, opposite, during)


def _slot(key: str, text: str, known: Mapping[str, Quantity], place: Place, faults: Faults) -> VariableSlot | None:
    """The input that a key names; None after a fault."""
    inputs = {name: quantity for name, quantity in known.items() if quantity.kind == "control"}
    try:
        return read_slot(text, inputs)
    except SlotError as error:
        faults.add((*place, key), f"{error}; forces act on bodies and motors: ball.force, ball.torque, knee.command")
        return None
