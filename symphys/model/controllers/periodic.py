"""Sines of one shared frequency and its multiples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from types import MappingProxyType
from typing import ClassVar

import casadi as ca

from symphys.model.numbers import table_key
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class Periodic:
    """u = b + sum over h = 1 .. harmonics of s_h sin(2 pi h f t) + c_h cos(2 pi h f t); see ``ControlLaw``.

    ``frequency`` f [Hz], ``offsets`` b (m,), ``sines`` and ``cosines`` (m harmonics,): s_1, s_2, ... one after the
    other. Nothing is sensed.
    """

    summary: ClassVar[str] = "Sines of one frequency and its multiples, about offsets."
    example: ClassVar[str] = "{ frequency = 1.5 }"
    numbers: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "frequency": "frequency of the first harmonic [Hz]",
            "offsets": "a number for each output; default 0",
            "sines": "a number for each output, or a list of them for each harmonic; default 0",
            "cosines": "as sines; default 0",
        }
    )
    needed: ClassVar[tuple[str, ...]] = ("frequency",)
    blind: ClassVar[bool] = True

    outputs: int
    harmonics: int = field(
        default=1,
        metadata=table_key("count", "number of harmonics"),
    )
    senses: int = 0

    @property
    def sizes(self) -> Mapping[str, int]:
        """Implement ``ControlLaw.sizes``."""
        count = self.outputs * self.harmonics
        return {"frequency": 1, "offsets": self.outputs, "sines": count, "cosines": count}

    def act(self, sensed: Expr, time: Expr, numbers: Mapping[str, Expr]) -> Expr:
        """Implement ``ControlLaw.act``."""
        result = numbers["offsets"]
        for h in range(self.harmonics):
            phase = 2 * ca.pi * (h + 1) * numbers["frequency"] * time
            part = slice(h * self.outputs, (h + 1) * self.outputs)
            result = result + numbers["sines"][part] * ca.sin(phase) + numbers["cosines"][part] * ca.cos(phase)
        return result
