"""How situations vary, as read from a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from symphys.problem.model import Kind, Simulation, Slot
from symphys.problem.parametric.joints import JointPlan

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Varied:
    """Numbers that are drawn: (components,) each slot.

    Attributes:
        name: as in the file.
        kind: of what is drawn.
        slots: what is drawn.
        factor: half the width of the factors; 0: none.
        shift: (components,) half the width of what is added.
        alike: whether all numbers share one draw.
        lasts: [s] of inputs, how long they act; 0: always.
        lower, upper: (components,) each slot, what is physical.
    """

    name: str
    kind: Kind
    slots: tuple[Slot, ...]
    factor: float
    shift: Array
    alike: bool
    lasts: float
    lower: Array
    upper: Array


@dataclass(frozen=True)
class Posed:
    """A robot whose pose is drawn, then lifted until it overlaps nothing that stands still.

    Attributes:
        name: as in the file.
        bodies: all that hangs together.
        joints: its rigid hinges that close no loop.
        tilt, bend: half the widths of turns about each axis of the world, and of the joints [rad].
        velocity: half the width of each component [m/s].
    """

    name: str
    bodies: tuple[str, ...]
    joints: tuple[JointPlan, ...]
    tilt: float
    bend: float
    velocity: float


@dataclass(frozen=True)
class Grid:
    """Another discretisation."""

    name: str
    simulation: Simulation


@dataclass(frozen=True)
class Scenarios:
    """All that differs from situation to situation."""

    varied: tuple[Varied, ...] = ()
    posed: tuple[Posed, ...] = ()
    grids: tuple[Grid, ...] = ()

    def __iter__(self) -> Iterator[Varied | Posed | Grid]:
        """One after the other."""
        return chain(self.varied, self.posed, self.grids)

    def __bool__(self) -> bool:
        """Whether there is anything."""
        return any(True for _ in self)
