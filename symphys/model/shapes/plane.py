"""The plane: a static half space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi
from types import MappingProxyType
from typing import Any, ClassVar

import casadi as ca

from symphys.model.numbers import Number
from symphys.model.scalar import Scalar, is_zero
from symphys.records import dataclass


@dataclass(frozen=True)
class Plane:
    """A static half space {x: normal . x < offset}; bodies stay on the other side.

    Attributes:
        name: how formulas and pairs refer to it.
        normal: (3,) unit vector, out of the solid.
        offset: [m].
    """

    kind: ClassVar[str] = "plane"
    plural: ClassVar[str] = "planes"
    contact_points: ClassVar[Mapping[str, int]] = {}
    numbers: ClassVar[Mapping[str, Number]] = MappingProxyType(
        {"offset": Number("m"), "tilt": Number("rad", least=-pi / 2, most=pi / 2, scale=0.01)}
    )

    name: str
    normal: tuple[Scalar, ...] = (0.0, 0.0, 1.0)
    offset: Scalar = 0.0

    @classmethod
    def ground(cls, height: Scalar = 0.0) -> Plane:
        """The floor: everything below ``height`` is solid."""
        return cls("ground", offset=height)

    @property
    def surface(self) -> Plane:
        """Return the surface that bodies may touch."""
        return self

    @property
    def parameters(self) -> dict[str, Any]:
        """The numbers that variables may set, by name."""
        return {"offset": self.offset, "tilt": (0.0, 0.0)}

    def with_parameters(self, values: Mapping[str, Any]) -> Plane:
        """The plane with other ``parameters``; see ``tilted``. The distance from the origin stays ``offset``."""
        flat = all(is_zero(angle) for angle in values["tilt"])
        normal = self.normal if flat else tilted(self.normal, values["tilt"])
        return replace(self, offset=values["offset"], normal=normal)


def tilted(normal: Sequence[float], tilt: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """(3,): a unit vector, turned by two angles [rad] about axes x, then y, perpendicular to it.

    These are the world's as the shortest turn from the z axis to ``normal`` carries them: the world's own for ground.
    """
    x, y, z = normal
    if z <= -1 + 1e-12:
        first, second = (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)
    else:
        mixed = -x * y / (1 + z)
        first, second = (1 - x * x / (1 + z), mixed, -x), (mixed, 1 - y * y / (1 + z), -y)
    a, b = tilt
    along = (ca.sin(b) * ca.cos(a), -ca.sin(a), ca.cos(b) * ca.cos(a))
    return tuple(along[0] * p + along[1] * q + along[2] * n for p, q, n in zip(first, second, normal, strict=True))
