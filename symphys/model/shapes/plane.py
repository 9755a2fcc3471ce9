"""The plane: a static half space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from symphys.model.scalar import Scalar


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

    name: str
    normal: tuple[Scalar, ...] = (0.0, 0.0, 1.0)
    offset: Scalar = 0.0

    @classmethod
    def ground(cls, height: Scalar = 0.0) -> Plane:
        """The floor: everything below ``height`` is solid."""
        return cls("ground", offset=height)

    @property
    def surface(self) -> Plane:
        """What bodies may touch."""
        return self

    @property
    def parameters(self) -> dict[str, Any]:
        """The numbers that variables may set, by name."""
        return {"offset": self.offset}

    def with_parameters(self, values: Mapping[str, Any]) -> Plane:
        """The plane with other ``parameters``."""
        return replace(self, **values)
