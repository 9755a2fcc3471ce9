"""The start as the guess has it: what formulas see there, and whether surfaces overlap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NoReturn

import casadi as ca
import numpy as np

from symphys.expression import FormulaError
from symphys.model.joints.frames import MEET, WORLD
from symphys.problem.checks.start_values import Start
from symphys.problem.model import DURATION, Variable
from symphys.problem.parametric.reposition import placing, reposition
from symphys.problem.parametric.starts import begin
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.quantities import Quantity
from symphys.problem.reading.faults import Faults
from symphys.suggest import quote
from symphys.types import Array

OVERLAP = 1e-3
"""Deepest overlap at the start [m]; more would be pushed out in the first steps, which is never meant."""


def at_guess(
    parametric: ParametricWorld, known: Mapping[str, Quantity], variables: Sequence[Variable]
) -> dict[str, Array]:
    """Every quantity's value at t = 0, with the first knot of every guess put in."""
    values = {name: quantity.nominal.copy() for name, quantity in known.items() if quantity.kind != "recording"}
    for variable in variables:
        for slot in variable.slots if variable.kind != "recording" else ():
            values[slot.name][list(slot.components)] = variable.guess[: variable.components]
    for name, value in values.items():
        if name.endswith(".orientation"):
            values[name] = value / max(float(np.linalg.norm(value)), 1e-12)
    varying, starts = varied(variables), {name: values.pop(name) for name in parametric.starts() if name in values}
    begun = begin(
        parametric,
        {name: ca.DM(value) for name, value in starts.items() if name in varying},
        {name: ca.DM(values[name]) for name, q in known.items() if q.kind == "initial" and name in values},
    )
    places = {name: ca.DM(values[name]) for name in placing(varying)}
    moved = reposition(parametric, places, begun)
    return values | {name: np.array(value).ravel() for name, value in moved.items()}


def varied(variables: Sequence[Variable]) -> list[str]:
    """The quantities that variables set."""
    return [slot.name for variable in variables for slot in variable.slots]


def formula_names(
    values: Mapping[str, Array], start: Start, variables: Sequence[Variable], warm_start: bool = True
) -> dict[str, Any]:
    """Every name that a formula may use, with a value of its shape; see ``Formula.evaluate``."""
    named: dict[str, Any] = {name: ca.DM(value) for name, value in values.items() if "-" not in name}
    named |= {"time": ca.DM(0.0), "duration": ca.DM(values[DURATION])}
    named |= start.quantities()
    if not warm_start:
        kept = (name for name, sensor in start.functions.sensors.items() if sensor.kind.kept)
        named |= {name: partial(_without_warm_start, name) for name in kept}
    return named | {variable.name: ca.DM(variable.guess) for variable in variables}


def _without_warm_start(name: str) -> NoReturn:
    text = "reads what joints gave in the step before, which is not kept; take out warm_start = false in [simulation]"
    raise FormulaError(f"{quote(name)} {text}")


def check_overlap(parametric: ParametricWorld, start: Start, faults: Faults) -> None:
    """Surfaces that may touch must not overlap at the start."""
    deepest: dict[tuple[str, str], float] = {}
    for pair, gap in zip(start.world.pairs, start.gaps(), strict=True):
        depth, owners = -gap, parametric.owners(pair)
        if not depth <= max(OVERLAP, deepest.get(owners, OVERLAP)):
            deepest[owners] = depth
    for (a, b), depth in deepest.items():
        index = body_index(parametric, a)
        verb = "overlaps" if any(body.name == b for body in parametric.bodies) else "sinks into"
        message = f"{a} {verb} {b} by {depth:.4g} m at the start; at most {OVERLAP:g} m is allowed"
        faults.add(("body", index, "position"), message)


def check_joints(parametric: ParametricWorld, start: Start, faults: Faults) -> None:
    """Joints must hold together at the start of the guess, within their limits."""
    if not parametric.joints:
        return
    for index, (joint, reading) in enumerate(zip(parametric.joints, start.joints(), strict=True)):
        both, place = f"{joint.second or WORLD} and {joint.first}", ("joint", index)
        apart, tilt = (round(part, 9) for part in reading[:2])
        if not max(apart, tilt) <= MEET:
            text = f"{apart:.4g} m and {tilt:.4g} rad from where the joint holds them; one variable must move both"
            cause = "the start of other joints, or " * any(each.start for each in parametric.joints)
            faults.add((*place, "between"), f"{cause}the guess of a variable puts {both} {text}")
        low, high = joint.limits.lower, joint.limits.upper
        for value in reading[2].round(9) + 0.0:
            if (low is not None and value < low - MEET) or (high is not None and value > high + MEET):
                text = f"leave out where {both} are at the start, at {value:.6g}; it is 0 as the bodies lie in the file"
                key = "limits" if faults.data["joint"][index].get("limits") is not None else "limits_deg"
                faults.add((*place, key), text)


def body_index(parametric: ParametricWorld, name: str) -> int:
    """The index of a body."""
    return [body.name for body in parametric.bodies].index(name)
