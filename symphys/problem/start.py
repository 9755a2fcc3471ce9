"""The start as the guess has it: what formulas see there, and whether surfaces overlap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import dist
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys import rotation
from symphys.problem.faults import Faults
from symphys.problem.model import Variable
from symphys.problem.plan import WorldPlan
from symphys.problem.quantities import Quantity
from symphys.shapes import Plane, Sphere
from symphys.world import Side, World

Array = NDArray[np.float64]
OVERLAP = 1e-3
"""Deepest overlap at the start [m]; more would be pushed out in the first steps, which nobody means."""


def at_guess(known: Mapping[str, Quantity], variables: Sequence[Variable]) -> dict[str, Array]:
    """Every quantity's value at t = 0, with the first knot of every guess put in."""
    values = {name: quantity.nominal.copy() for name, quantity in known.items()}
    for variable in variables:
        for slot in variable.slots:
            values[slot.name][list(slot.components)] = variable.guess[: variable.components]
    for name, value in values.items():
        if name.endswith(".orientation"):
            values[name] = value / max(float(np.linalg.norm(value)), 1e-12)
    return values


def formula_names(values: Mapping[str, Array], variables: Sequence[Variable]) -> dict[str, Any]:
    """Every name that a formula may use, with a value of its shape."""
    named: dict[str, Any] = {name: ca.DM(value) for name, value in values.items() if "-" not in name}
    named["time"] = ca.DM(0.0)
    return named | {variable.name: ca.DM(variable.guess) for variable in variables}


def check_overlap(plan: WorldPlan, values: Mapping[str, Array], faults: Faults) -> None:
    """Surfaces that may touch must not overlap at the start."""
    world = plan.world({name: parameter(values[name]) for name in plan.parameters()})
    meeting = {side.body for pair in world.pairs for side in (pair.first, pair.second) if side.body is not None}
    centres = {index: shape_centres(world, index, values) for index in meeting}
    deepest: dict[tuple[str, str], float] = {}
    for pair in world.pairs:
        depth = -gap(world, centres, pair.first, pair.second)
        owners = plan.owners(pair)
        if not depth <= max(OVERLAP, deepest.get(owners, OVERLAP)):
            deepest[owners] = depth
    for (a, b), depth in deepest.items():
        index = plan_index(plan, a)
        verb = "overlaps" if any(body.name == b for body in plan.bodies) else "sinks into"
        message = f"{a} {verb} {b} by {depth:.4g} m at the start; at most {OVERLAP:g} m is allowed"
        faults.add(("body", index, "position"), message)


def parameter(value: Array) -> float | tuple[float, ...]:
    """A parameter's value as worlds take it."""
    return float(value[0]) if value.size == 1 else tuple(value.tolist())


def plan_index(plan: WorldPlan, name: str) -> int:
    """The index of a body."""
    return [body.name for body in plan.bodies].index(name)


def shape_centres(world: World, index: int, values: Mapping[str, Array]) -> Array:
    """(shapes, 3): centres of a body's shapes in the world [m]."""
    body = world.bodies[index]
    position, orientation = values[f"{body.name}.position"], values[f"{body.name}.orientation"]
    turned = np.array(rotation.matrix(ca.DM(orientation)))
    offsets = np.array([shape.centre for shape in body.shapes], float).reshape(-1, 3)
    return np.asarray(position + offsets @ turned.T)


def gap(world: World, centres: Mapping[int, Array], first: Side, second: Side) -> float:
    """The distance between two surfaces [m], negative when they overlap; inf for pairs that are not looked at."""
    assert first.body is not None
    shape, other = world.surface(first), world.surface(second)
    if not isinstance(shape, Sphere):
        return np.inf
    centre = centres[first.body][first.shape]
    if isinstance(other, Plane):
        return float(np.dot(other.normal, centre) - other.offset - shape.radius)
    if not isinstance(other, Sphere) or second.body is None:
        return np.inf
    return float(dist(centre, centres[second.body][second.shape]) - shape.radius - other.radius)
