"""The interface of every kind of controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

from symphys.types import Expr


class DeclaredLaw(Protocol):
    """The declaration of a kind of controller for its table in problem files; see ``CONTROLLERS``.

    Its other fields with metadata are keys of the table too; see ``symphys.model.numbers``.

    Attributes:
        summary: description of the table.
        example: of the table.
        numbers: descriptions of the numbers that a table gives, by the names of ``ControlLaw.sizes``; 0 by default.
        needed: those of them that a table must give, each one number.
        blind: whether it senses nothing.
    """

    summary: ClassVar[str]
    example: ClassVar[str]
    numbers: ClassVar[Mapping[str, str]]
    needed: ClassVar[tuple[str, ...]]
    blind: ClassVar[bool]


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
