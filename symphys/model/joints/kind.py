"""A kind of joint as data: the screws that it leaves free, and what it locks.

Each side carries a frame, a point with three axes. ``a`` are the axes of the first side's frame, ``b`` those of the
second's: columns of (3, 3), world frame. At coordinates 0 the frames coincide. Each coordinate is a screw about or
along one of these axes, so a joint's motion subspace S(q) is read off the placed frames, and its transform X(q) is the
product of the screws' displacements (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 4). What is locked is
the complement of S.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from symphys.maths import rotation
from symphys.maths.angles import nearest
from symphys.model.scalar import Scalar, is_zero
from symphys.types import Expr

TINY = 1e-24
"""[m^2/rad^2] Added to the square of a lead that is divided by, so that a lead of 0 gives a finite number."""


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
    """A motion that a joint leaves free: a screw about, or along, an axis of one of its frames.

    Attributes:
        name: ``angle`` or ``position``; with a number where there are two.
        value: of the placed frames; an angle but for whole turns.
        axis: which axis of its frame, 0 for x: about which, or along which, the first side moves as the value grows.
        turns: whether the value is the angle of a rotation about the axis [rad], else a displacement along it [m].
        lead: displacement along the axis by the value: 1 of a displacement, [m/rad] of a screw, 0 of a hinge.
        fixed_in_first: whether the axis moves with the first side, else with the second.
    """

    name: str
    value: Callable[[PlacedFrames], Expr]
    axis: int = 0
    turns: bool = True
    lead: Scalar = 0.0
    fixed_in_first: bool = False

    @property
    def slides(self) -> bool:
        """Whether the first side moves along the axis; a matter of structure."""
        return not is_zero(self.lead)

    @property
    def is_screw(self) -> bool:
        """Whether the first side turns and moves along the axis at once."""
        return self.turns and self.slides

    @property
    def unit(self) -> str:
        """The unit of the value."""
        return "rad" if self.turns else "m"

    def direction(self, placed: PlacedFrames) -> Expr:
        """(3,) unit vector, world frame: the axis."""
        return (placed.a if self.fixed_in_first else placed.b)[:, self.axis]

    def motion(self, placed: PlacedFrames) -> tuple[Expr, Expr]:
        """The displacement and the rotation (3,) of the first side by the value, world frame: a column of S."""
        axis, none = self.direction(placed), ca.DM.zeros(3)
        return self.lead * axis if self.slides else none, axis if self.turns else none

    def along(self, placed: PlacedFrames) -> tuple[Expr, Expr]:
        """Rows (m, 3) of forces and (n, 3) of torques that act along the value; of a screw its torque."""
        axis, none = self.direction(placed).T, ca.SX(0, 3)
        return (none, axis) if self.turns else (axis, none)


@dataclass(frozen=True)
class Kind:
    """What a joint leaves free, and what it locks.

    Attributes:
        name: in problem files.
        slides: axes of the second frame along which the first may not move; None: it may not move at all.
        turns: pairs (i, j): axis i of the first frame stays perpendicular to axis j of the second. A free rotation
            less for each.
        coordinates: what is left. Axes of the second frame come before those of the first.
    """

    units: ClassVar[Mapping[str, str]] = {}
    """The units of ``numbers``."""

    name: str
    slides: tuple[int, ...] | None = None
    turns: tuple[tuple[int, int], ...] = ()
    coordinates: tuple[Coordinate, ...] = ()

    @property
    def numbers(self) -> dict[str, Scalar]:
        """Numbers of its own by their keys in problem files; variables may set them."""
        return {}

    def valued(self, numbers: Mapping[str, Scalar]) -> Kind:
        """The same kind with other ``numbers``."""
        return self

    @property
    def travels(self) -> bool:
        """Whether the points of the frames move apart."""
        return self.slides is not None

    @property
    def screws(self) -> tuple[Coordinate, ...]:
        """The coordinates that turn and move along their axis: each locks one of these to the other."""
        return tuple(each for each in self.coordinates if each.is_screw)

    @property
    def held(self) -> int:
        """How many of the locked rows are displacements; they come first."""
        return 3 if self.slides is None else len(self.slides) + len(self.screws)

    @property
    def locked(self) -> int:
        """How many rows are locked."""
        return self.held + len(self.turns)

    @property
    def free(self) -> int:
        """How many motions are left, with coordinates or without."""
        return 6 - self.locked

    @property
    def winds(self) -> bool:
        """Whether its coordinates are angles, which count whole turns."""
        return any(coordinate.turns for coordinate in self.coordinates)

    @property
    def turning(self) -> bool:
        """Whether what is left are rotations, else displacements."""
        return not self.coordinates or self.coordinates[0].turns

    @property
    def quantity(self) -> str:
        """What formulas call its coordinates: ``angle`` or ``position``."""
        return "angle" if self.turning else "position"

    def axes(self, placed: PlacedFrames) -> Expr:
        """(3, free) unit vectors, world frame: of the coordinates; where there are none, the second frame's."""
        if not self.coordinates:
            return placed.b[:, : self.free]
        return ca.horzcat(*(each.direction(placed) for each in self.coordinates))

    def motions(self, placed: PlacedFrames) -> list[tuple[Expr, Expr]]:
        """S: (displacement, rotation) (3,) each of the first side against the second, for each motion left free."""
        if self.coordinates:
            return [each.motion(placed) for each in self.coordinates]
        return [(ca.DM.zeros(3), axis) for axis in ca.horzsplit(self.axes(placed))] if self.free else []

    def rates(self, placed: PlacedFrames, linear: Expr, angular: Expr) -> list[Expr]:
        """The rates of the free motions, as the first side moves against the second [m/s], [rad/s], world frame."""
        if self.coordinates:
            return [ca.dot(each.direction(placed), angular if each.turns else linear) for each in self.coordinates]
        return [ca.dot(turn, angular) for _, turn in self.motions(placed)]

    def transform(self, axes: Expr, moved: Expr) -> tuple[Expr, Expr]:
        """X: the rotation (4,) and the displacement (3,) of the first side, its free motions going on by ``moved``.

        Args:
            axes: (3, free) as they lie before.
            moved: (free,) [rad], [m].
        """
        if not self.coordinates:
            turn = rotation.exponential(ca.mtimes(axes, moved)) if self.free else ca.DM([1, 0, 0, 0])
            return turn, ca.DM.zeros(3)
        turn, shift = None, ca.DM.zeros(3)
        for k, each in enumerate(self.coordinates):
            if each.turns:
                half = moved[k] / 2
                about = ca.vertcat(ca.cos(half), ca.sin(half) * axes[:, k])
                turn = about if turn is None else rotation.multiply(turn, about)
            if each.slides:
                shift = shift + each.lead * moved[k] * axes[:, k]
        return ca.DM([1, 0, 0, 0]) if turn is None else turn, shift

    def locks(self, placed: PlacedFrames) -> tuple[Expr | None, Expr, Expr | None]:
        """The complement of S: rows of what is locked, world frame.

        Returns:
            (held, 3) along which no displacement is left, None: the world's three; (n, 3) about which no rotation is;
            (held, 3) the rotations that displacements along the first rows go with, None: none.
        """
        turns = ca.vertcat(ca.DM(0, 3), *(ca.cross(placed.a[:, i], placed.b[:, j]).T for i, j in self.turns))
        if self.slides is None:
            return None, turns, None
        rows = [placed.b[:, j].T for j in self.slides]
        axes = [each.direction(placed).T for each in self.screws]
        leads = [-each.lead * axis for each, axis in zip(self.screws, axes, strict=True)]
        return ca.vertcat(*rows, *axes), turns, ca.vertcat(ca.DM(len(rows), 3), *leads) if leads else None

    def errors(self, placed: PlacedFrames, near: Expr | None = None) -> Expr:
        """(locked,): how far the joint is from what it locks [m], [rad].

        ``near``: (k,) its coordinates to within half a turn, which tell how often a screw has turned; None: as often as
        its displacement says.
        """
        if self.slides is None:
            off = placed.apart
        else:
            rows = [ca.dot(placed.b[:, j], placed.apart) for j in self.slides]
            off = ca.vertcat(*rows, *(self._off(k, placed, near) for k in range(len(self.coordinates))))
        return ca.vertcat(off, *(ca.dot(placed.a[:, i], placed.b[:, j]) for i, j in self.turns))

    def _off(self, k: int, placed: PlacedFrames, near: Expr | None) -> Expr:
        """(1,), or (0,) of what is no screw: its displacement less that of its angle [m]."""
        each = self.coordinates[k]
        if not each.is_screw:
            return ca.DM(0, 1)
        along = ca.dot(each.direction(placed), placed.apart)
        about = along * each.lead / (each.lead**2 + TINY) if near is None else near[k]
        return along - each.lead * nearest(each.value(placed), about)
