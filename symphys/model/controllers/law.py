"""What every kind of controller gives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from symphys.types import Expr


class ControlLaw(Protocol):
    """Outputs of m numbers from n that are sensed and from the time."""

    @property
    def senses(self) -> int:
        """n."""

    @property
    def outputs(self) -> int:
        """m."""

    @property
    def sizes(self) -> Mapping[str, int]:
        """Its numbers by name, such as ``weights`` or ``gains``, in order, and how many each has."""

    def act(self, sensed: Expr, time: Expr, numbers: Mapping[str, Expr]) -> Expr:
        """(m,) the outputs.

        Args:
            sensed: (n,).
            time: [s].
            numbers: for each name of ``sizes`` a column.
        """
