"""The [[cost]], [[target]], [[constraint]] and [[output]] tables: formulas, tried once on the start of the guess."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np

from symphys.expression import Formula, FormulaError, parse
from symphys.expression.units import unit_of
from symphys.problem.model import ALIVE, Constraint, Cost, Output, Phase, Simulation, Target, Termination
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema import Document
from symphys.problem.schema.checks import OF_PHASE
from symphys.problem.schema.objectives import ConstraintTable, CostTable, OutputTable, TargetTable
from symphys.problem.tables.simulation import check_moment, find_phase
from symphys.records import dataclass
from symphys.types import Array

NO_PHASES: Mapping[str, Phase] = MappingProxyType({})


def read_termination(
    document: Document, sample: Mapping[str, Any], inputs: Collection[str], faults: Faults
) -> Termination | None:
    """The termination; None without one, or with a faulty formula.

    Args:
        document: the file, with one of the two tables or none.
        sample: every name that a sensor may read, with its value at the start of the guess.
        inputs: names of forces, torques and commands, which are not of the state.
        faults: gets what is wrong.
    """
    key, table = document.ending
    if table is None:
        return None
    place = (key, "margin")
    try:
        formula = parse(table.margin)
        value = ca.DM(formula.evaluate({k: v for k, v in sample.items() if k != "time" and k not in inputs}))
    except FormulaError as error:
        faults.add(place, str(error))
        return None
    if value.shape[0] != 1:
        faults.add(place, f"must be a number, but is a vector of {value.shape[0]}; min(a, b) is the smaller one")
    elif not float(value) >= 0:
        faults.add(place, f"is {float(value):.4g} at the start of the guess, so it would be over at once; 0 or more")
    return Termination(formula)


def with_termination_cost(document: Document, costs: tuple[Cost, ...], faults: Faults) -> tuple[Cost, ...]:
    """The costs, running ones until the termination, and that of the time which is left; it is called as the table."""
    key, table = document.ending
    if table is None:
        return costs
    for index, cost in enumerate(costs):
        if cost.name == key:
            faults.add(("cost", index, "name"), f'"{key}" is the name of the cost that [{key}] adds; choose another')
    left = Cost(key, parse(f"1 - {ALIVE}"), "always", table.cost, squares=True)
    stopped = [
        replace(cost, formula=parse(f"({cost.formula.text}) * {ALIVE}")) if cost.at == "always" else cost
        for cost in costs
    ]
    return (*stopped, *([left] if table.cost > 0 else []))


@dataclass(frozen=True)
class Objectives:
    """The objective of a problem: costs, targets and constraints, with outputs and phases."""

    costs: tuple[Cost, ...]
    targets: tuple[Target, ...]
    constraints: tuple[Constraint, ...]
    outputs: tuple[Output, ...]
    phases: tuple[Phase, ...] = ()


def read_objectives(
    document: Document,
    simulation: Simulation,
    sample: Mapping[str, Any],
    units: Mapping[str, str],
    faults: Faults,
    phases: Mapping[str, Phase] = NO_PHASES,
    free: bool = False,
) -> Objectives:
    """Read the tables; ``sample`` has a value for each name in formulas, ``units`` its unit where that is known.

    ``phases`` by name; ``free``: whether a variable sets the duration.
    """
    reader = ObjectiveReader(simulation, sample, units, phases, faults, free)
    costs = [reader.cost(index, table) for index, table in enumerate(document.cost)]
    targets = [reader.target(index, table) for index, table in enumerate(document.target)]
    constraints = [reader.constraint(index, table) for index, table in enumerate(document.constraint)]
    outputs = [reader.output(index, table) for index, table in enumerate(document.output)]
    return Objectives(
        tuple(cost for cost in costs if cost),
        tuple(target for target in targets if target),
        tuple(constraint for constraint in constraints if constraint),
        tuple(output for output in outputs if output),
        tuple(phases.values()),
    )


class ObjectiveReader:
    """Reads one table at a time; None stands for one with a faulty formula."""

    def __init__(
        self,
        simulation: Simulation,
        sample: Mapping[str, Any],
        units: Mapping[str, str],
        phases: Mapping[str, Phase],
        faults: Faults,
        free: bool,
    ) -> None:
        """Keep what every table needs."""
        self.simulation, self.sample, self.units, self.phases = simulation, sample, units, phases
        self.faults, self.free = faults, free

    def moment(self, table: CostTable | ConstraintTable, place: Place) -> tuple[str | float, Phase | None]:
        """Return when a formula is evaluated, and the phase within which it always is."""
        if table.during is None:
            return self.instant(table.at, place), None
        if "at" in table.model_fields_set:
            self.faults.add((*place, "during"), "stands instead of at; leave one of them out")
        return "always", find_phase(table.during, self.phases, (*place, "during"), self.faults)

    def instant(self, at: str | float, place: Place) -> str | float:
        """The end, or a time; that of a step, whatever the duration. "end of" a phase is a time as well."""
        named = re.fullmatch(OF_PHASE, at) if isinstance(at, str) else None
        if named:
            phase = find_phase(named[2], self.phases, (*place, "at"), self.faults)
            tick = 0 if phase is None else phase.ticks(self.simulation.steps)[named[1] == "end"]
            return "end" if tick == self.simulation.steps else tick * self.simulation.dt
        check_moment(at, self.simulation, (*place, "at"), self.faults)
        if self.free and at not in ("end", "always", 0):
            text = 'is no time of a step, since a variable sets the duration; take "end", "always", 0, or a [[phase]]'
            self.faults.add((*place, "at"), text)
        return at

    def formula(self, place: Place, text: str, at: str | float) -> tuple[Formula, int] | None:
        """The formula and the length of its value; notes why there is none."""
        try:
            formula = parse(text, whole=True)
            parts = {part.name: part.formula.evaluate(self.sample) for part in formula.parts}
            value = formula.evaluate({**self.sample, **parts})
        except FormulaError as error:
            self.faults.add(place, str(error))
            return None
        if formula.parts:
            if at == "always":
                text = f"has {formula.parts[0].name}, which is of the whole motion, so it has no value for each instant"
                self.faults.add((*place[:-1], "at"), f'{text}; take "end", the default')
            return formula, int(value.shape[0])
        if at in ("always", 0) and not ca.DM(value).is_regular():
            self.faults.add(place, "is not a finite number at the start of the guess")
        return formula, int(value.shape[0])

    def cost(self, index: int, table: CostTable) -> Cost | None:
        """Read a cost."""
        place = ("cost", index)
        at, during = self.moment(table, place)
        if (table.value is None) == (table.squares is None):
            self.faults.add((*place, "value"), "give either value (a number) or squares (a vector)")
            return None
        squares = table.squares is not None
        key = "squares" if squares else "value"
        found = self.formula((*place, key), table.squares or table.value or "", at)
        if found and not squares and found[1] != 1:
            text = f"must be a number, but is a vector of {found[1]}; use squares instead of value, or sumsqr(...)"
            self.faults.add((*place, key), text)
        if squares and table.weight < 0:
            self.faults.add((*place, "weight"), "a sum of squares needs a weight of at least 0; use value to maximise")
        return found and Cost(table.name, found[0], at, table.weight, squares, during)

    def target(self, index: int, table: TargetTable) -> Target | None:
        """Read a target."""
        place = ("target", index)
        at = self.instant(table.at, place)
        found = self.formula((*place, "value"), table.value, at)
        if not found:
            return None
        unit = table.unit or unit_of(found[0], self.units)
        return Target(table.name, found[0], at, table.tolerance, table.weight, unit)

    def output(self, index: int, table: OutputTable) -> Output | None:
        """Read an output."""
        place = ("output", index)
        at = self.instant(table.at, place)
        found = self.formula((*place, "value"), table.value, at)
        if found and found[1] != 1:
            self.faults.add((*place, "value"), f"must be a number, but is a vector of {found[1]}; give one for each")
        return found and Output(table.name, found[0], at, table.unit or "")

    def constraint(self, index: int, table: ConstraintTable) -> Constraint | None:
        """Read a constraint."""
        place = ("constraint", index)
        at, during = self.moment(table, place)
        found = self.formula((*place, "value"), table.value, at)
        if table.equals is not None and (table.lower is not None or table.upper is not None):
            self.faults.add((*place, "equals"), "stands instead of lower and upper; leave them out")
        if table.equals is None and table.lower is None and table.upper is None:
            self.faults.add((*place, "lower"), "give lower, upper or both, or equals")
        if not found:
            return None
        ends = {"lower": -np.inf, "upper": np.inf}
        lower, upper = (self.bound(place, table, key, default, found[1]) for key, default in ends.items())
        if lower.shape == upper.shape and np.any(lower > upper):
            self.faults.add((*place, "lower"), "exceeds upper")
        unit = table.unit or unit_of(found[0], self.units)
        return Constraint(table.name, found[0], at, lower, upper, table.tolerance, table.penalty, unit, during)

    def bound(self, place: Place, table: ConstraintTable, key: str, default: float, length: int) -> Array:
        """(length,): one of the two bounds."""
        key = key if table.equals is None else "equals"
        given = getattr(table, key)
        bound = np.atleast_1d(np.array(default if given is None else given, float))
        if bound.ndim > 1 or bound.size not in (1, length):
            wanted = f"a number or {length} numbers, as the value is a vector of {length}" if length > 1 else "a number"
            self.faults.add((*place, key), f"must be {wanted}")
            return np.full(length, default)
        return np.broadcast_to(bound, length).copy()
