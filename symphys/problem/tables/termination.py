"""The [fall] table: where a motion is over, and what that does to costs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from symphys.expression import Formula, FormulaError, parse
from symphys.problem.model import Cost
from symphys.problem.reading.faults import Faults
from symphys.problem.schema.objectives import FallTable

ALIVE = "alive"
COST = "fall"


@dataclass(frozen=True)
class Fall:
    """Where a motion is over before its time: from then on nothing moves.

    Attributes:
        margin: of a number of the state; over where it is below 0.
    """

    margin: Formula


def read_fall(
    table: FallTable | None, sample: Mapping[str, Any], inputs: Collection[str], faults: Faults
) -> Fall | None:
    """The fall; None without one, or with a faulty formula.

    Args:
        table: of the file.
        sample: every name that a sensor may read, with its value at the start of the guess.
        inputs: names of forces, torques and commands, which are not of the state.
        faults: gets what is wrong.
    """
    if table is None:
        return None
    place = ("fall", "margin")
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
    return Fall(formula)


def stopped(cost: Cost) -> Cost:
    """A running cost that stops at the fall."""
    return replace(cost, formula=parse(f"({cost.formula.text}) * {ALIVE}")) if cost.at == "always" else cost


def costs_of_falling(table: FallTable, costs: tuple[Cost, ...], faults: Faults) -> tuple[Cost, ...]:
    """The costs as a fall leaves them, and that of the time which is left."""
    if any(cost.name == COST for cost in costs):
        index = [cost.name for cost in costs].index(COST)
        faults.add(("cost", index, "name"), f'"{COST}" is the name of the cost that [fall] adds; choose another')
    last = Cost(COST, parse(f"1 - {ALIVE}"), "always", table.cost, squares=True)
    return (*map(stopped, costs), *([last] if table.cost > 0 else []))
