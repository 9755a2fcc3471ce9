"""Sensors, controllers and force laws of a problem after validation."""

from __future__ import annotations

from dataclasses import dataclass, field

from symphys.expression import Formula
from symphys.model.controllers import ControlLaw
from symphys.types import Array


@dataclass(frozen=True)
class Sensor:
    """Something that controllers may use.

    Attributes:
        name: as in the file.
        formulas: of its parts, one after the other.
        size: how many numbers they come to.
    """

    name: str
    formulas: tuple[Formula, ...]
    size: int


@dataclass(frozen=True)
class FeedbackController:
    """What drives inputs in every step.

    Attributes:
        name: as in the file.
        law: how outputs follow from what is sensed.
        senses: names of the sensors, whose values are joined.
        drives: for each output the name of an input and the component that it is added to.
        scale: (m,) factors of the outputs.
        numbers: the law's numbers as the file has them, by the names of ``law.sizes``.
    """

    name: str
    law: ControlLaw
    senses: tuple[str, ...]
    drives: tuple[tuple[str, int], ...]
    scale: Array = field(repr=False)
    numbers: dict[str, Array] = field(repr=False)

    @property
    def weights(self) -> dict[str, Array]:
        """The numbers by the names that variables use: ``brain.weights``."""
        return {f"{self.name}.{key}": value for key, value in self.numbers.items()}


@dataclass(frozen=True)
class ForceLaw:
    """What adds to an input in every step, by a formula of the state.

    Attributes:
        name: as in the file.
        on: the input: ``ball.force`` [N], ``ball.torque`` [N m], both world frame, or ``knee.command``.
        components: of the input.
        formula: of as many numbers.
        against: an input and components to which the opposite is added; None: nothing.
        numbers: of the formula, as the file has them.
        during: where the phase in which alone it acts begins and ends, as shares of the duration; None: it acts always.
    """

    name: str
    on: str
    components: tuple[int, ...]
    formula: Formula
    numbers: dict[str, Array] = field(repr=False)
    against: tuple[str, tuple[int, ...]] | None = None
    during: tuple[float, float] | None = None

    @property
    def acts_on(self) -> tuple[tuple[str, tuple[int, ...], int], ...]:
        """Inputs, their components, and the sign with which the formula is added."""
        opposite = () if self.against is None else ((*self.against, -1),)
        return ((self.on, self.components, 1), *opposite)

    @property
    def weights(self) -> dict[str, Array]:
        """The numbers by the names that variables and formulas use: ``drag.c``."""
        return {f"{self.name}.{key}": value for key, value in self.numbers.items()}
