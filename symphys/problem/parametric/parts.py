"""The parts of a parametric world: bodies, static surfaces and [[pair]] tables, with numbers that may be replaced.

Inertia is given by numbers that bounds alone keep physical: second moments of the mass, and how they are correlated.
With Sigma = integral of x x' dm about the centre of mass, the inertia is trace(Sigma) 1 - Sigma. A rigid body has this
inertia if and only if Sigma is positive semidefinite (Wensing, Kim and Slotine, IEEE RA-L 3(1), 2018), which holds the
triangle inequalities of its moments too. Sigma is given by its diagonal, which must not be negative, and by three
correlations in [-1, 1]: xy, xz, and yz for given x. These are partial correlations (Lewandowski, Kurowicka and Joe,
J. Multivariate Analysis 100(9), 2009), of which any three make a correlation matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cached_property
from math import sqrt
from typing import Any

import casadi as ca
import numpy as np

from symphys.model.body import Body, SiteMotor
from symphys.model.numbers import Number, numbers_of
from symphys.model.scalar import Scalar, is_zero
from symphys.model.shapes import Shape, Sphere, Static, Surface
from symphys.model.shapes.inertia import MOMENT_ROUNDING, Tensor, inertia_of, specific
from symphys.model.world import Law
from symphys.records import dataclass

Numbers = float | tuple[float, ...]
Value = Callable[[str], Any]
"""A parameter's value by name: a scalar, or a tuple of them."""
LAW = tuple(each.name for each in fields(Law) if "value" in each.metadata)
"""The coefficients of a contact law, all of which a [[pair]] table may state."""
COEFFICIENTS = numbers_of(Law)
"""Those that are parameters where stated."""
DISTRIBUTION = ("second_moments", "correlations")
"""Parameters of a body that follow from mass, shape and inertia unless they are set."""
CENTRE = "centre_of_mass"
INERTIAL: Mapping[str, Number] = {
    "mass": Number("kg", least=0.0, exceeds=True),
    "second_moments": Number("kg m^2", least=0.0, floored=True),
    "correlations": Number("", least=-1.0, most=1.0, scale=0.1),
    CENTRE: Number("m", scale=0.01),
}
"""Parameters of every body with mass."""


def distribution(tensor: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Second moments (3,) [kg m^2] and correlations (3,) [-] of an inertia as ``Body`` has it, body frame."""
    given = np.asarray(tensor, float)
    whole = given if given.ndim == 2 else np.diag(np.broadcast_to(given, 3))
    sigma = np.trace(whole) / 2 * np.eye(3) - whole
    moments = np.where(np.diag(sigma) > MOMENT_ROUNDING * np.trace(whole), np.diag(sigma), 0.0)
    if not np.any(whole - np.diag(np.diag(whole))):
        return tuple(moments.tolist()), (0.0, 0.0, 0.0)
    width = np.sqrt(moments)
    xy, xz, yz = (_ratio(sigma[i, j], width[i] * width[j]) for i, j in ((0, 1), (0, 2), (1, 2)))
    return tuple(moments.tolist()), (xy, xz, _ratio(yz - xy * xz, sqrt((1 - xy * xy) * (1 - xz * xz))))


def _ratio(part: float, whole: float) -> float:
    """Return the ratio of a product to its bound, in [-1, 1]; 0 if the bound is 0."""
    return max(-1.0, min(1.0, float(part / whole))) if whole > 0 else 0.0


def inertia(moments: Sequence[Scalar], correlations: Sequence[Scalar]) -> Any:
    """The inertia [kg m^2] as ``Body`` takes it, body frame: principal moments if nothing is correlated."""
    a, b, c = moments
    if all(is_zero(each) for each in correlations):
        return b + c, a + c, a + b
    xy, xz, rest = correlations
    yz = xy * xz + rest * ca.sqrt((1 - xy * xy) * (1 - xz * xz))
    x, y, z = (ca.sqrt(each) for each in moments)
    pxy, pxz, pyz = -xy * x * y, -xz * x * z, -yz * y * z
    return (b + c, pxy, pxz), (pxy, a + c, pyz), (pxz, pyz, a + b)


def stated(states: Mapping[str, Any]) -> dict[str, Numbers]:
    """Return the coefficients that variables may set."""
    known = {key: number for key, number in states.items() if key in COEFFICIENTS}
    return {key: number for key, number in known.items() if number or not COEFFICIENTS[key].structural}


@dataclass(frozen=True)
class ParametricBody:
    """A body.

    Attributes:
        name: unique among bodies, static surfaces and groups.
        mass: [kg].
        density: [kg/m^3] if the mass follows a single shape's size, else None.
        shapes: its surface, in the body frame.
        hollow: whether a single sphere is a shell.
        inertia: [kg m^2] as given; None: from mass and shape.
        states: coefficients that its surface states, by name.
        collides_with: names of the surfaces and groups that it may touch; None: all.
        group: that it belongs to.
    """

    name: str
    mass: float
    density: float | None
    shapes: tuple[Shape, ...]
    hollow: bool
    inertia: Any
    states: Mapping[str, Any]
    collides_with: frozenset[str] | None
    group: str | None = None

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """Return the surfaces that may touch others."""
        return self.shapes

    def parameters(self) -> dict[str, Numbers]:
        """Parameter names and values."""
        own: dict[str, Numbers] = {}
        if self.mass:
            own = {
                "mass": self.mass,
                **dict(zip(DISTRIBUTION, self._distribution, strict=True)),
                CENTRE: (0.0, 0.0, 0.0),
            }
        own |= self._sizes
        return {f"{self.name}.{key}": numbers for key, numbers in (own | stated(self.states)).items()}

    @property
    def numbers(self) -> Mapping[str, Number]:
        """Return what is known of its numbers, by key."""
        return {**INERTIAL, **COEFFICIENTS, **(self.shapes[0].numbers if len(self.shapes) == 1 else {})}

    def valued(self, overrides: Mapping[str, Any], value: Value) -> Body:
        """The body with its parameters' values; mass by density and inertia follow the size unless overridden."""
        if not self.mass:
            return Body.frame(self.name)
        body = self._centred(overrides, value)
        if any(f"{self.name}.{key}" in overrides for key in DISTRIBUTION):
            moments, correlations = (value(f"{self.name}.{key}") for key in DISTRIBUTION)
            body = replace(body, inertia=inertia(moments, correlations))
        centre = self.centre(value)
        if all(is_zero(c) for c in centre):
            return body
        return replace(body, shapes=tuple(replace(s, centre=less(s.centre, centre)) for s in body.shapes))

    def centre(self, value: Value) -> tuple[Scalar, ...]:
        """(3,) [m]: where the centre of mass lies in the frame in which the file has shapes, sites and joints."""
        return tuple(value(f"{self.name}.{CENTRE}")) if self.mass else (0.0, 0.0, 0.0)

    def _centred(self, overrides: Mapping[str, Any], value: Value) -> Body:
        """Return the body with its centre of mass at the origin of the file's frame."""
        mass = value(f"{self.name}.mass")
        if len(self.shapes) != 1:
            return Body(self.name, mass, self._inertia(mass, self._specific), self.shapes)
        own = {key: f"{self.name}.{key}" for key in self._sizes}
        shape = self.shapes[0].resized({key: value(name) for key, name in own.items()})
        varied = any(name in overrides for name in own.values())
        if self.density is not None and varied and f"{self.name}.mass" not in overrides:
            mass = self.density * shape.volume
        if self.inertia is None and isinstance(shape, Sphere) and not any(shape.centre):
            return replace(Body.ball(self.name, shape.radius, mass, self.hollow), shapes=(shape,))
        return Body(self.name, mass, self._inertia(mass, specific((shape,)) if varied else self._specific), (shape,))

    @cached_property
    def _distribution(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Second moments of the mass and their correlations as the file has the body."""
        nominal = {f"{self.name}.{key}": number for key, number in self._sizes.items()} | {
            f"{self.name}.mass": self.mass
        }
        return distribution(self._centred({}, nominal.__getitem__).inertia)

    @property
    def _sizes(self) -> Mapping[str, Any]:
        return self.shapes[0].parameters if len(self.shapes) == 1 else {}

    @cached_property
    def _specific(self) -> Tensor:
        return specific(self.shapes) if self.inertia is None else []

    def heavier(self, factor: float) -> ParametricBody:
        """The body with its mass and inertia times a factor."""
        density = None if self.density is None else self.density * factor
        return replace(self, mass=self.mass * factor, density=density, inertia=_times(self.inertia, factor))

    def _inertia(self, mass: Scalar, tensor: Tensor) -> Any:
        return inertia_of(tensor, mass) if self.inertia is None else self.inertia


def less(point: Any, shift: Any) -> tuple[Scalar, ...]:
    """A point less a vector (3,)."""
    return tuple(a - b for a, b in zip(point, shift, strict=True))


def _times(numbers: Any, factor: float) -> Any:
    """Multiply each number in nested tuples by a factor; None stays."""
    if isinstance(numbers, tuple):
        return tuple(_times(each, factor) for each in numbers)
    return None if numbers is None else numbers * factor


@dataclass(frozen=True)
class ParametricSite:
    """A site by the name of its body; None: the world. See ``Site``."""

    name: str
    body: str | None
    position: tuple[float, float, float]
    orientation: tuple[float, ...]
    motor: SiteMotor | None = None


@dataclass(frozen=True)
class ParametricStatic:
    """A static surface.

    Attributes:
        static: as the file has it.
        states: coefficients that its surface states, by name.
        group: that it belongs to.
        collides_with: names of the bodies and groups that may touch it; None: all.
    """

    static: Static
    states: Mapping[str, Any]
    group: str | None = None
    collides_with: frozenset[str] | None = None

    @property
    def name(self) -> str:
        """Unique among bodies, static surfaces and groups."""
        return self.static.name

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """Return the surface that may be touched."""
        return (self.static.surface,)

    def parameters(self) -> dict[str, Numbers]:
        """Parameter names and values."""
        return {f"{self.name}.{key}": number for key, number in (self.static.parameters | stated(self.states)).items()}

    @property
    def numbers(self) -> Mapping[str, Number]:
        """Return what is known of its numbers, by key."""
        return {**COEFFICIENTS, **self.static.numbers}

    def valued(self, value: Value) -> Static:
        """The surface with its parameters' values."""
        return self.static.with_parameters({key: value(f"{self.name}.{key}") for key in self.static.parameters})


Part = ParametricBody | ParametricStatic


@dataclass(frozen=True)
class PairRule:
    """The content of a [[pair]] table of two surfaces or groups; ``states`` holds any coefficients of a law.

    ``between`` has one name where a group meets itself.
    """

    name: str
    between: frozenset[str]
    collide: bool
    states: Mapping[str, Any]

    @property
    def numbers(self) -> Mapping[str, Number]:
        """Return what is known of its numbers, by key."""
        return COEFFICIENTS

    def parameters(self) -> dict[str, Numbers]:
        """Parameter names and values."""
        return {f"{self.name}.{key}": number for key, number in stated(self.states).items()}
