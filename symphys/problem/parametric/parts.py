"""The plans of a world's parts: bodies, static surfaces and [[pair]] tables, with numbers that may be replaced."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any, ClassVar

from symphys.model.shapes import Fixture, Plane, Scalar, Shape, Sphere, Static, Surface, Terrain
from symphys.model.world import Body
from symphys.problem.checks.inertia import Tensor, simplest, specific, volume
from symphys.problem.parametric.sizes import resized, sizes

Numbers = float | tuple[float, ...]
Value = Callable[[str], Any]
"""A parameter's value by name: a scalar, or a tuple of them."""

COMBINE: dict[str, Callable[[list[Scalar]], Scalar]] = {
    "friction": prod,
    "restitution": prod,
    "torsion": sum,
    "rolling": sum,
}
VARIABLE = ("friction", "restitution")
"""The coefficients that are parameters where stated."""


def stated(states: Mapping[str, float]) -> dict[str, Numbers]:
    """Those of the coefficients that may be varied."""
    return {key: number for key, number in states.items() if key in VARIABLE}


@dataclass(frozen=True)
class BodyPlan:
    """A body.

    Attributes:
        name: unique among bodies, static surfaces and groups.
        mass: [kg].
        density: [kg/m^3] if the mass follows a single shape's size, else None.
        shapes: its surface, in the body frame.
        hollow: whether a single sphere is a shell.
        inertia: [kg m^2] as given; None: from mass and shape.
        states: coefficients that its surface states, by name.
        mates: names of the surfaces and groups that it may touch; None: all.
        group: that it belongs to.
    """

    name: str
    mass: float
    density: float | None
    shapes: tuple[Shape, ...]
    hollow: bool
    inertia: Any
    states: Mapping[str, float]
    mates: frozenset[str] | None
    group: str | None = None

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """What may touch others."""
        return self.shapes

    def parameters(self) -> dict[str, Numbers]:
        """Parameter names and values."""
        own: dict[str, Numbers] = {"mass": self.mass}
        if len(self.shapes) == 1:
            own |= sizes(self.shapes[0])
        return {f"{self.name}.{key}": numbers for key, numbers in (own | stated(self.states)).items()}

    def body(self, overrides: Mapping[str, Any], value: Value) -> Body:
        """The body with its parameters' values; a mass given by density follows the size unless overridden."""
        mass = value(f"{self.name}.mass")
        if len(self.shapes) != 1:
            return Body(self.name, mass, self._inertia(mass, self._specific), self.shapes)
        own = {key: f"{self.name}.{key}" for key in sizes(self.shapes[0])}
        shape = resized(self.shapes[0], {key: value(name) for key, name in own.items()})
        varied = any(name in overrides for name in own.values())
        if self.density is not None and varied and f"{self.name}.mass" not in overrides:
            mass = self.density * volume(shape)
        if self.inertia is None and isinstance(shape, Sphere) and not any(shape.centre):
            return replace(Body.ball(self.name, shape.radius, mass, self.hollow), shapes=(shape,))
        return Body(self.name, mass, self._inertia(mass, specific((shape,)) if varied else self._specific), (shape,))

    @cached_property
    def _specific(self) -> Tensor:
        return specific(self.shapes) if self.inertia is None else []

    def _inertia(self, mass: Scalar, tensor: Tensor) -> Any:
        if self.inertia is not None:
            return self.inertia
        simple = simplest(tensor)
        if not isinstance(simple, tuple):
            return simple * mass
        return tuple(tuple(x * mass for x in row) if isinstance(row, tuple) else row * mass for row in simple)


@dataclass(frozen=True)
class PlanePlan:
    """A static plane: unit normal (3,), offset [m], the coefficients that it states, and its group."""

    name: str
    normal: tuple[float, float, float]
    offset: float
    states: Mapping[str, float]
    group: str | None = None
    mates: ClassVar[None] = None

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """What may be touched."""
        return (Plane(self.name, self.normal, self.offset),)

    def parameters(self) -> dict[str, Numbers]:
        """Parameter names and values."""
        return {f"{self.name}.{key}": number for key, number in ({"offset": self.offset} | stated(self.states)).items()}

    def static(self, value: Value) -> Static:
        """The plane with its parameters' values."""
        return Plane(self.name, self.normal, value(f"{self.name}.offset"))


@dataclass(frozen=True)
class BlockPlan:
    """A static solid: its shape in world coordinates, the coefficients that it states, and its group."""

    name: str
    shape: Shape
    states: Mapping[str, float]
    group: str | None = None
    mates: ClassVar[None] = None

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """What may be touched."""
        return (self.shape,)

    def parameters(self) -> dict[str, Numbers]:
        """Parameter names and values."""
        own: dict[str, Numbers] = {"position": self.shape.centre}
        return {f"{self.name}.{key}": numbers for key, numbers in (own | stated(self.states)).items()}

    def static(self, value: Value) -> Static:
        """The fixture with its parameters' values."""
        return Fixture(self.name, replace(self.shape, centre=value(f"{self.name}.position")))


@dataclass(frozen=True)
class TerrainPlan:
    """Static ground of varying height: ``height(x, y)`` [m], the coefficients that it states, and its group."""

    name: str
    height: Callable[[Any, Any], Any]
    states: Mapping[str, float]
    group: str | None = None
    mates: ClassVar[None] = None

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """What may be touched."""
        return (Terrain(self.name, self.height),)

    def parameters(self) -> dict[str, Numbers]:
        """Parameter names and values."""
        return {f"{self.name}.{key}": number for key, number in stated(self.states).items()}

    def static(self, value: Value) -> Static:
        """The terrain."""
        return Terrain(self.name, self.height)


StaticPlan = PlanePlan | BlockPlan | TerrainPlan
Part = BodyPlan | StaticPlan


@dataclass(frozen=True)
class PairPlan:
    """What a [[pair]] table states between two surfaces or groups; ``states`` may hold frequency and damping too.

    ``between`` has one name where a group meets itself.
    """

    name: str
    between: frozenset[str]
    collide: bool
    states: Mapping[str, float]

    def parameters(self) -> dict[str, Numbers]:
        """Parameter names and values."""
        return {f"{self.name}.{key}": number for key, number in stated(self.states).items()}
