"""Terrain: static ground of varying height."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, ClassVar

from symphys.model.numbers import Number
from symphys.records import dataclass


@dataclass(frozen=True)
class Terrain:
    """Static ground of varying height: everything below the surface z = height(x, y) is solid.

    Attributes:
        name: how formulas and pairs refer to it.
        height: of casadi scalars x, y [m], world frame; twice differentiable.
    """

    kind: ClassVar[str] = "terrain"
    plural: ClassVar[str] = "terrains"
    contact_points: ClassVar[Mapping[str, int]] = {}
    numbers: ClassVar[Mapping[str, Number]] = MappingProxyType({})

    name: str
    height: Callable[[Any, Any], Any]

    @property
    def surface(self) -> Terrain:
        """Return the surface that bodies may touch."""
        return self

    @property
    def parameters(self) -> dict[str, Any]:
        """The numbers that variables may set, by name: none."""
        return {}

    def with_parameters(self, values: Mapping[str, Any]) -> Terrain:
        """Itself."""
        return self
