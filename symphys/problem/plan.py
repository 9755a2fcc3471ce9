"""The plan of a world: bodies, planes and who touches whom under which law, with numbers that may be replaced.

The rule for a pair of surfaces: what its [[pair]] table states holds. Else friction and restitution are the product
of what the two surfaces state, torsion and rolling (lengths) their sum. Where neither states it, [contact] holds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.problem.inertia import specific, volume
from symphys.shapes import Plane, Scalar, Sphere
from symphys.world import Body, Law, Pair, World, all_pairs

Array = NDArray[np.float64]
Value = Callable[[str], Scalar]
"""A parameter's value by name."""

COMBINE: dict[str, Callable[[list[Scalar]], Scalar]] = {
    "friction": prod,
    "restitution": prod,
    "torsion": sum,
    "rolling": sum,
}
VARIABLE = ("friction", "restitution")
"""The coefficients that are parameters where stated."""


@dataclass(frozen=True)
class BodyPlan:
    """A body.

    Attributes:
        name: unique among bodies and planes.
        mass: [kg].
        density: [kg/m^3] if the mass follows a single sphere's radius, else None.
        spheres: its surface; radius [m], centre (3,) [m] in the body frame.
        hollow: whether a single sphere is a shell.
        inertia: [kg m^2] as given; None: from mass and shape.
        states: coefficients that its surface states, by name.
        mates: names of the surfaces that it may touch; None: all.
    """

    name: str
    mass: float
    density: float | None
    spheres: tuple[Sphere, ...]
    hollow: bool
    inertia: Any
    states: Mapping[str, float]
    mates: frozenset[str] | None

    def parameters(self) -> dict[str, float]:
        """Parameter names and values."""
        own = {"mass": self.mass}
        if len(self.spheres) == 1:
            own["radius"] = self.spheres[0].radius
        return {f"{self.name}.{key}": number for key, number in (own | stated(self.states)).items()}

    def body(self, overrides: Mapping[str, Any], value: Value) -> Body:
        """The body with its parameters' values; a mass given by density follows the radius unless overridden."""
        mass = value(f"{self.name}.mass")
        if len(self.spheres) != 1:
            return Body(self.name, mass, self._inertia(mass), self.spheres)
        radius = value(f"{self.name}.radius")
        if self.density is not None and f"{self.name}.radius" in overrides and f"{self.name}.mass" not in overrides:
            mass = self.density * volume(radius)
        ball = Body.ball(self.name, radius, mass, self.hollow)
        shapes = (replace(self.spheres[0], radius=radius),)
        return replace(ball, shapes=shapes, inertia=ball.inertia if self.inertia is None else self.inertia)

    def _inertia(self, mass: Scalar) -> Any:
        if self.inertia is not None:
            return self.inertia
        tensor = specific(self.spheres)
        diagonal = np.diag(tensor)
        if np.any(tensor != np.diag(diagonal)):
            return tuple(tuple(float(entry) * mass for entry in row) for row in tensor)
        if np.all(diagonal == diagonal[0]):
            return float(diagonal[0]) * mass
        return tuple(float(moment) * mass for moment in diagonal)


@dataclass(frozen=True)
class PlanePlan:
    """A static plane: unit normal (3,), offset [m], and the coefficients that it states."""

    name: str
    normal: tuple[float, float, float]
    offset: float
    states: Mapping[str, float]

    def parameters(self) -> dict[str, float]:
        """Parameter names and values."""
        return {f"{self.name}.{key}": number for key, number in ({"offset": self.offset} | stated(self.states)).items()}


@dataclass(frozen=True)
class PairPlan:
    """What a [[pair]] table states between two surfaces; ``states`` may hold frequency and damping too."""

    name: str
    between: frozenset[str]
    collide: bool
    states: Mapping[str, float]

    def parameters(self) -> dict[str, float]:
        """Parameter names and values."""
        return {f"{self.name}.{key}": number for key, number in stated(self.states).items()}


def stated(states: Mapping[str, float]) -> dict[str, float]:
    """Those of the coefficients that may be varied."""
    return {key: number for key, number in states.items() if key in VARIABLE}


@dataclass(frozen=True)
class WorldPlan:
    """Everything that a world is built from.

    Attributes:
        bodies, planes, pairs: in the file's order.
        contact: the law where nothing else is stated.
        gravity: (3,) [m/s^2].
    """

    bodies: tuple[BodyPlan, ...]
    planes: tuple[PlanePlan, ...]
    pairs: tuple[PairPlan, ...]
    contact: Law
    gravity: tuple[float, float, float]

    def parameters(self) -> dict[str, Array]:
        """Every parameter with its value, (1,), or (3,) for gravity."""
        numbers = {"gravity": np.array(self.gravity)}
        parts: tuple[BodyPlan | PlanePlan | PairPlan, ...] = (*self.bodies, *self.planes, *self.pairs)
        for part in parts:
            numbers |= {name: np.array([number]) for name, number in part.parameters().items()}
        return numbers

    def world(self, overrides: Mapping[str, Any]) -> World:
        """The world with some parameters replaced; KeyError for a name that is none."""
        nominal = self.parameters()
        for name in overrides:
            if name not in nominal:
                raise KeyError(f"{name!r} is no parameter; there are {', '.join(nominal)}")

        def value(name: str) -> Scalar:
            return overrides[name] if name in overrides else float(nominal[name][0])

        bodies = tuple(plan.body(overrides, value) for plan in self.bodies)
        planes = tuple(Plane(plan.name, plan.normal, value(f"{plan.name}.offset")) for plan in self.planes)
        gravity = overrides.get("gravity", self.gravity)
        return World(bodies, planes, self._pairs(bodies, planes, value), tuple(gravity[i] for i in range(3)))

    def _pairs(self, bodies: tuple[Body, ...], planes: tuple[Plane, ...], value: Value) -> tuple[Pair, ...]:
        laws: dict[frozenset[str], Law | None] = {}
        pairs = []
        for pair in all_pairs(bodies, planes, self.contact):
            owners = self.owners(pair)
            key = frozenset(owners)
            if key not in laws:
                laws[key] = self.law(*owners, value) if self.meets(*owners) else None
            law = laws[key]
            if law is not None:
                pairs.append(replace(pair, law=law))
        return tuple(pairs)

    def owners(self, pair: Pair) -> tuple[str, str]:
        """The names of the two bodies, or of the body and the plane."""
        sides = (pair.first, pair.second)
        first, second = (
            self.planes[side.shape].name if side.body is None else self.bodies[side.body].name for side in sides
        )
        return first, second

    def meets(self, a: str, b: str) -> bool:
        """Whether the two may touch: each lets the other, and no [[pair]] table forbids it."""
        pair = self.pair(a, b)
        return self._lets(a, b) and self._lets(b, a) and (pair is None or pair.collide)

    def _lets(self, a: str, b: str) -> bool:
        part = self._parts[a]
        return not isinstance(part, BodyPlan) or part.mates is None or b in part.mates

    def pair(self, a: str, b: str) -> PairPlan | None:
        """The [[pair]] table of the two, if there is one."""
        return self._tables.get(frozenset((a, b)))

    @cached_property
    def _parts(self) -> dict[str, BodyPlan | PlanePlan]:
        parts: tuple[BodyPlan | PlanePlan, ...] = (*self.bodies, *self.planes)
        return {part.name: part for part in parts}

    @cached_property
    def _tables(self) -> dict[frozenset[str], PairPlan]:
        return {pair.between: pair for pair in self.pairs}

    def law(self, a: str, b: str, value: Value) -> Law:
        """The contact law of the two by the rule above; friction and restitution with their parameters' values."""
        pair = self.pair(a, b)
        own = pair.states if pair else {}
        states = {name: self._parts[name].states for name in (a, b)}
        found: dict[str, Scalar] = {}
        for key, combine in COMBINE.items():
            if pair and key in own:
                found[key] = value(f"{pair.name}.{key}") if key in VARIABLE else own[key]
                continue
            sides = [value(f"{x}.{key}") if key in VARIABLE else states[x][key] for x in (a, b) if key in states[x]]
            if sides:
                found[key] = combine(sides)
        found |= {key: own[key] for key in ("frequency", "damping") if key in own}
        return replace(self.contact, **found)
