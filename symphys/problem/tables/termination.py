"""The [termination] table, formerly [fall]: where a motion is over, and what that does to costs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.expression import FormulaError, parse
from symphys.problem.model import ALIVE, Cost, Termination
from symphys.problem.reading.faults import Faults
from symphys.problem.schema import Document


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
    return (*map(until_termination, costs), *([left] if table.cost > 0 else []))


def until_termination(cost: Cost) -> Cost:
    """A running cost that stops at the termination."""
    return replace(cost, formula=parse(f"({cost.formula.text}) * {ALIVE}")) if cost.at == "always" else cost
