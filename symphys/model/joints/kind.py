"""A kind of joint as data: what it locks, and which coordinates are left.

Each side carries a frame, a point with three axes. ``a`` are the axes of the first side's frame, ``b`` those of the
second's: columns of (3, 3), world frame. At coordinates 0 the frames coincide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from symphys.types import Expr


@dataclass(frozen=True)
class PlacedFrames:
    """Both frames of a joint in the world.

    Attributes:
        a, b: (3, 3) axes of the first and of the second side's frame.
        apart: (3,) [m] from the second frame to the first.
    """

    a: Expr
    b: Expr
    apart: Expr


@dataclass(frozen=True)
class Coordinate:
    """A motion that a joint leaves free.

    Attributes:
        name: ``angle`` or ``position``; with a number where there are two.
        turns: whether it is a rotation [rad], else a displacement [m].
        value: of the placed frames; an angle but for whole turns.
        axis: (3,) unit vector, world frame: about which, or along which, the first side moves as the value grows.
        fixed_in_first: whether the axis moves with the first side, else with the second.
    """

    name: str
    turns: bool
    value: Callable[[PlacedFrames], Expr]
    axis: Callable[[PlacedFrames], Expr]
    fixed_in_first: bool = False


@dataclass(frozen=True)
class Kind:
    """What a joint locks.

    Attributes:
        name: in problem files.
        slides: axes of the second frame along which the first may not move; None: it may not move at all.
        turns: pairs (i, j): axis i of the first frame stays perpendicular to axis j of the second. A free rotation
            less for each.
        coordinates: what is left.
    """

    name: str
    slides: tuple[int, ...] | None = None
    turns: tuple[tuple[int, int], ...] = ()
    coordinates: tuple[Coordinate, ...] = ()

    @property
    def winds(self) -> bool:
        """Whether its coordinates are angles, which count whole turns."""
        return any(coordinate.turns for coordinate in self.coordinates)
