"""The [[variable]] tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.problem.limits import check_mass
from symphys.problem.model import Kind, Simulation, Variable, VariableSlot
from symphys.problem.quantities import Quantity, SlotError, limits, read_slot
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.objectives import VariableTable
from symphys.problem.schema.types import NestedList
from symphys.types import Array, Bools


class VariableReader:
    """Reads one table; every fault is noted below its place."""

    def __init__(self, index: int, table: VariableTable, known: Mapping[str, Quantity], faults: Faults) -> None:
        """Keep what all steps need."""
        self.place: Place = ("variable", index)
        self.table = table
        self.known = known
        self.faults = faults
        self.count = 1

    def add(self, key: str, message: str) -> None:
        """Note a fault of one key."""
        self.faults.add((*self.place, key), message)

    def read(self, simulation: Simulation) -> Variable | None:
        """The variable; None if what it sets is unclear."""
        slots = self.slots()
        if not slots:
            return None
        kind = self.known[slots[0].name].kind
        self.count = len(slots[0].components)
        self.check_knots(kind, simulation)
        limit = [limits(slot, self.known) for slot in slots]
        scale = self.numbers("scale", self.usual_scale(slots))
        variable = Variable(
            name=self.table.name,
            kind=kind,
            slots=slots,
            knots=self.table.knots,
            interpolation=self.table.interpolation,
            guess=self.numbers("guess", self.nominal(slots)),
            lower=self.numbers("lower", np.max([low for low, _ in limit], axis=0)),
            upper=self.numbers("upper", np.min([high for _, high in limit], axis=0)),
            scale=scale,
            spread=self.numbers("spread", None) if self.table.spread is not None else scale / 10,
            each=self.table.each is not None,
            prior=self.prior(),
        )
        if variable.each and kind == "duration":
            self.add("each", "the duration is the same for all recordings; leave this out")
        self.check_numbers(variable)
        return variable

    def slots(self) -> tuple[VariableSlot, ...]:
        """Read the slots of a variable; empty after a fault."""
        found = []
        for text in self.table.sets:
            try:
                found.append(read_slot(text, self.known))
            except SlotError as error:
                self.add("sets", str(error))
                return ()
        kinds = {self.known[slot.name].kind for slot in found}
        if len(kinds) > 1:
            self.add(
                "sets", f"sets quantities of different kinds ({', '.join(sorted(kinds))}); use one variable for each"
            )
            return ()
        if len({len(slot.components) for slot in found}) > 1:
            listed = ", ".join(f"{slot.name} ({len(slot.components)})" for slot in found)
            self.add("sets", f"sets quantities with different numbers of components: {listed}")
            return ()
        return tuple(found)

    def check_knots(self, kind: Kind, simulation: Simulation) -> None:
        """Only inputs have knots, and not more than the time steps can tell apart."""
        knots, linear = self.table.knots, self.table.interpolation == "linear"
        if kind != "control":
            for key in ("knots", "interpolation"):
                if key in self.table.model_fields_set and (key, knots) != ("knots", 1):
                    self.add(
                        key, "only a force or a torque, or the command of a motor, varies over time; leave this key out"
                    )
            return
        most = simulation.steps + linear
        if knots > most:
            self.add("knots", f"{knots} knots are more than the {simulation.steps} time steps can tell apart ({most})")
        if linear and knots < 2:
            self.add("knots", "linear interpolation needs 2 or more knots")

    def nominal(self, slots: Sequence[VariableSlot]) -> Array | None:
        """(components,): the value in the file, if it is the same for all slots."""
        values = [self.known[slot.name].nominal[list(slot.components)] for slot in slots]
        same = all(np.array_equal(a, b) for a, b in pairwise(values))
        return values[0] if same else None

    def usual_scale(self, slots: Sequence[VariableSlot]) -> Array | float:
        """Return the typical change of the quantities: the least of their scales, else their own size."""
        scales = [scale for slot in slots if (scale := self.known[slot.name].number.scale) is not None]
        if scales:
            return min(scales)
        value = self.nominal(slots)
        return 1.0 if value is None else np.where(value == 0, 1.0, np.abs(value))

    def numbers(self, key: str, default: NestedList | Array | None) -> Array:
        """(components * knots,): the key's value, or the default, for every component and knot."""
        given = getattr(self.table, key)
        value = default if given is None else given
        if value is None:
            self.add(key, "this key is required, as the quantities that are set have different values in the file")
            value = 0.0
        try:
            return spread_out(value, self.count, self.table.knots)
        except ValueError as error:
            self.add(key, str(error))
            return spread_out(0.0, self.count, self.table.knots)

    def prior(self) -> tuple[Array, Array] | None:
        """Mean and standard deviation, (components,) each."""
        if self.table.prior is None:
            return None
        ends = [np.array(numbers) for numbers in self.table.prior]
        if any(end.size not in (1, self.count) for end in ends):
            wanted = f"a number or {self.count} numbers" if self.count > 1 else "a number"
            self.add("prior", f"mean and standard deviation must each be {wanted}")
            return None
        mean, deviation = (np.broadcast_to(end, self.count).copy() for end in ends)
        return mean, deviation

    def check_numbers(self, variable: Variable) -> None:
        """Bounds in order and physical, the guess inside them, positive scale."""
        for key, floor in (("scale", np.nextafter(0, 1)), ("spread", 0.0)):
            if np.any(getattr(variable, key) < floor):
                self.add(key, "must be positive" if key == "scale" else "must not be negative")
        if np.any(variable.lower > variable.upper):
            self.add("lower", f"exceeds upper{self.where(variable.lower > variable.upper)}")
            return
        outside = (variable.guess < variable.lower) | (variable.guess > variable.upper)
        if np.any(outside):
            k = int(np.argmax(outside))
            low, high = variable.lower[k], variable.upper[k]
            origin = "the guess" if self.table.guess is not None else "the value in the file, which is the guess,"
            text = f"{origin} {variable.guess[k]:g} is outside the bounds {low:g} to {high:g}{self.where(outside)}"
            self.add("guess", text)
        self.check_physical(variable)

    def check_physical(self, variable: Variable) -> None:
        """Bounds must not allow a negative mass, and the like; a quaternion must not be zero."""
        for slot in variable.slots:
            name = slot.name.rpartition(".")[2]
            number = self.known[slot.name].number
            if np.any(variable.lower < number.least) or (number.exceeds and np.any(variable.lower <= number.least)):
                what = "be greater than" if number.exceeds else "be at least"
                self.add("lower", f"{slot.name} must {what} {number.least:g}")
            if np.any(variable.upper > number.most):
                self.add("upper", f"{slot.name} must be at most {number.most:g}")
            if name == "mass":
                check_mass((*self.place, "guess"), float(variable.guess[0]), self.faults)
            if name == "orientation" and len(slot.components) == 4 and not np.any(variable.guess):
                self.add("guess", "a quaternion must not be zero; [1, 0, 0, 0] is no rotation")

    def where(self, mask: Bools) -> str:
        """Return the suffix that names the component, if there are several."""
        k = int(np.argmax(mask))
        component = f" in component {k % self.count}" if self.count > 1 else ""
        return component + (f" at knot {k // self.count}" if self.table.knots > 1 else "")


def spread_out(value: NestedList | Array, components: int, knots: int) -> Array:
    """(components * knots,): numbers, one number per component, or one list per knot; ValueError if they do not fit."""
    given: Any = np.asarray(value).tolist() if isinstance(value, np.ndarray) else value
    rows: list[Any] = given if isinstance(given, list) else [given] * components
    if rows and isinstance(rows[0], list):
        if len(rows) != knots or any(len(row) != components for row in rows):
            raise ValueError(f"must be {knots} lists of {components} numbers, one per knot")
        return np.array(rows, float).ravel()
    if len(rows) == components:
        return np.tile(np.array(rows, float), knots)
    if components == 1 and len(rows) == knots:
        return np.array(rows, float)
    several = f" or {components} numbers" if components > 1 else ""
    per_knot = f", or {knots} lists of {components}" if knots > 1 else ""
    raise ValueError(f"must be a number{several}{per_knot}; it has {len(rows)}")


def read_variables(
    tables: Sequence[VariableTable], known: Mapping[str, Quantity], simulation: Simulation, faults: Faults
) -> tuple[Variable, ...]:
    """Read the variables; note quantities that are set twice."""
    found = [VariableReader(index, table, known, faults).read(simulation) for index, table in enumerate(tables)]
    owners: dict[str, NDArray[np.intp]] = {name: np.full(quantity.nominal.size, -1) for name, quantity in known.items()}
    for index, variable in enumerate(found):
        for slot in variable.slots if variable else ():
            owner, components = owners[slot.name], list(slot.components)
            taken = owner[components] >= 0
            if taken.any():
                component = components[int(np.argmax(taken))]
                text = f"{slot.name}[{component}] is already set by variable {tables[owner[component]].name}"
                faults.add(("variable", index, "sets"), text)
                break
            owner[components] = index
    return tuple(variable for variable in found if variable)
