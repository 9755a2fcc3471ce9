"""The start as the guess has it: what formulas see there, and whether surfaces overlap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.dynamics.observation import accelerometers, body_quantities, gap_function, joint_quantities, readings
from symphys.model.joints.frames import MEET, WORLD
from symphys.model.state_layout import GIVEN, initial_state
from symphys.model.world import World
from symphys.problem.model import Variable
from symphys.problem.parametric.reposition import reposition
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.quantities import Quantity
from symphys.problem.reading.faults import Faults

Array = NDArray[np.float64]
OVERLAP = 1e-3
"""Deepest overlap at the start [m]; more would be pushed out in the first steps, which is never meant."""


def at_guess(
    parametric: ParametricWorld, known: Mapping[str, Quantity], variables: Sequence[Variable]
) -> dict[str, Array]:
    """Every quantity's value at t = 0, with the first knot of every guess put in."""
    values = {name: quantity.nominal.copy() for name, quantity in known.items()}
    for variable in variables:
        for slot in variable.slots:
            values[slot.name][list(slot.components)] = variable.guess[: variable.components]
    for name, value in values.items():
        if name.endswith(".orientation"):
            values[name] = value / max(float(np.linalg.norm(value)), 1e-12)
    anchors = {name: ca.DM(values[name]) for name in varied(variables) if name.endswith(".anchor")}
    moved = reposition(
        parametric, anchors, {name: ca.DM(values[name]) for name, q in known.items() if q.kind == "initial"}
    )
    return values | {name: np.array(value).ravel() for name, value in moved.items()}


def varied(variables: Sequence[Variable]) -> list[str]:
    """The quantities that variables set."""
    return [slot.name for variable in variables for slot in variable.slots]


def formula_names(
    parametric: ParametricWorld, values: Mapping[str, Array], variables: Sequence[Variable]
) -> dict[str, Any]:
    """Every name that a formula may use, with a value of its shape."""
    named: dict[str, Any] = {name: ca.DM(value) for name, value in values.items() if "-" not in name}
    named["time"] = ca.DM(0.0)
    world, x = start_of(parametric, values)
    still = {body.name: values[f"{body.name}.velocity"] for body in world.bodies}
    found = joint_quantities(world, x) | body_quantities(world, x) | accelerometers(world, x, still, 1.0)
    named.update({name: ca.evalf(ca.SX(value)) for name, value in found.items()})
    return named | {variable.name: ca.DM(variable.guess) for variable in variables}


def sensor_names(parametric: ParametricWorld, values: Mapping[str, Array]) -> dict[str, Any]:
    """Every name that a sensor may read, with a value of its shape: all but the variables."""
    return formula_names(parametric, values, ())


def check_overlap(parametric: ParametricWorld, values: Mapping[str, Array], faults: Faults) -> None:
    """Surfaces that may touch must not overlap at the start."""
    world, x = start_of(parametric, values)
    gaps = np.array(gap_function(world)(x)).ravel()
    deepest: dict[tuple[str, str], float] = {}
    for pair, gap in zip(world.pairs, gaps, strict=True):
        depth, owners = -gap, parametric.owners(pair)
        if not depth <= max(OVERLAP, deepest.get(owners, OVERLAP)):
            deepest[owners] = depth
    for (a, b), depth in deepest.items():
        index = body_index(parametric, a)
        verb = "overlaps" if any(body.name == b for body in parametric.bodies) else "sinks into"
        message = f"{a} {verb} {b} by {depth:.4g} m at the start; at most {OVERLAP:g} m is allowed"
        faults.add(("body", index, "position"), message)


def start_of(parametric: ParametricWorld, values: Mapping[str, Array]) -> tuple[World, Any]:
    """The world and its state (DM) at the start of the guess."""
    world = parametric.world({name: parameter(values[name]) for name in parametric.parameters()})
    given = {f"{body.name}.{field}": values[f"{body.name}.{field}"] for body in world.bodies for field in GIVEN}
    return world, initial_state(world, given)


def check_joints(parametric: ParametricWorld, values: Mapping[str, Array], faults: Faults) -> None:
    """Joints must hold together at the start of the guess, within their limits."""
    if not parametric.joints:
        return
    world, x = start_of(parametric, values)
    for index, (joint, reading) in enumerate(zip(parametric.joints, readings(world, x).values(), strict=True)):
        both, place = f"{joint.second or WORLD} and {joint.first}", ("joint", index)
        apart, tilt = (round(float(ca.evalf(ca.SX(part))), 9) for part in (reading.separation, reading.tilt))
        if not max(apart, tilt) <= MEET:
            text = f"{apart:.4g} m and {tilt:.4g} rad from where the joint holds them; one variable must move both"
            cause = "the start of other joints, or " * any(each.start for each in parametric.joints)
            faults.add((*place, "between"), f"{cause}the guess of a variable puts {both} {text}")
        low, high = joint.limits.lower, joint.limits.upper
        for value in np.array(ca.evalf(ca.SX(reading.value))).ravel().round(9) + 0.0:
            if (low is not None and value < low - MEET) or (high is not None and value > high + MEET):
                text = f"leave out where {both} are at the start, at {value:.6g}; it is 0 as the bodies lie in the file"
                key = "limits" if faults.data["joint"][index].get("limits") is not None else "limits_deg"
                faults.add((*place, key), text)


def parameter(value: Array) -> float | tuple[float, ...]:
    """A parameter's value as worlds take it."""
    return float(value[0]) if value.size == 1 else tuple(value.tolist())


def body_index(parametric: ParametricWorld, name: str) -> int:
    """The index of a body."""
    return [body.name for body in parametric.bodies].index(name)
