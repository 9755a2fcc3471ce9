"""The [[force]] tables: forces, torques and commands that follow from the state by a formula."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.observation import SENSOR_KINDS
from symphys.expression import FormulaError, parse
from symphys.problem.feedback import ForceLaw
from symphys.problem.model import Phase, Variable, VariableSlot
from symphys.problem.quantities import OWN_SIZE, Quantity, SlotError, read_slot
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.control import ForceTable
from symphys.problem.tables.simulation import find_phase
from symphys.suggest import quote

NOT_AHEAD = tuple(f".{kind.key}" for kind in SENSOR_KINDS if not kind.ahead)
"""Ends of the names of what is not known half a step ahead."""
VARYING = ("parameter", "weight")
"""Kinds of variables that have one value over the whole motion, which a law may name."""


def force_quantities(tables: Sequence[ForceTable]) -> dict[str, Quantity]:
    """The numbers of all force laws by the names that variables and formulas use, such as ``drag.c``."""
    return {
        f"{table.name}.{key}": Quantity("weight", np.ravel(np.array(value, float)), OWN_SIZE)
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
    """Every law that is clear.

    Args:
        tables: as they are in the file.
        known: every quantity; those of kind "control" can be added to.
        sample: a value for each name in formulas, as the guess has it.
        variables: of the problem.
        phases: by name.
        faults: gets what is wrong.
    """
    found = [_read(index, table, known, sample, variables, phases, faults) for index, table in enumerate(tables)]
    return tuple(law for law in found if law is not None)


def _read(
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
        if kinds.get(name, VARYING[0]) not in VARYING:
            instead = " or ".join(slot.name for v in variables if v.name == name for slot in v.slots)
            faults.add((*place, "value"), f"the variable {quote(name)} sets {instead}; name that instead")
        if name.endswith(NOT_AHEAD):
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
