"""Kinds of joints as data: the screws that a kind leaves free, and the rows that it locks.

Each side carries a frame, a point with three axes. ``a`` are the axes of the first side's frame, ``b`` those of the
second's: columns of (3, 3), world frame. At coordinates 0 the frames coincide. Each coordinate is a screw about or
along one of these axes, so a joint's motion subspace S(q) is read off the placed frames, and its transform X(q) is the
product of the screws' displacements (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 4). What is locked is
the complement of S.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import casadi as ca

from symphys.maths import rotation
from symphys.maths.angles import nearest
from symphys.model.numbers import numbers_of
from symphys.model.scalar import Scalar, is_zero
from symphys.records import dataclass
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
        """Whether the first side moves along the axis; it depends on structure, not on a symbol's value."""
        return not is_zero(self.lead)

    @property
    def is_screw(self) -> bool:
        """Whether the first side turns and moves along the axis at once."""
        return self.turns and self.slides

    @property
    def unit(self) -> str:
        """Return the unit of the value."""
        return "rad" if self.turns else "m"

    def direction(self, placed: PlacedFrames) -> Expr:
        """Return the axis, a unit vector (3,), world frame."""
        return (placed.a if self.fixed_in_first else placed.b)[:, self.axis]

    def motion(self, placed: PlacedFrames) -> tuple[Expr, Expr]:
        """Return a column of S: displacement and rotation (3,) of the first side per unit of the value, world frame."""
        axis, none = self.direction(placed), ca.DM.zeros(3)
        return self.lead * axis if self.slides else none, axis if self.turns else none

    def along(self, placed: PlacedFrames) -> tuple[Expr, Expr]:
        """Return rows (m, 3) of forces and (n, 3) of torques that act along the value; a screw has a torque."""
        axis, none = self.direction(placed).T, ca.SX(0, 3)
        return (none, axis) if self.turns else (axis, none)


@dataclass(frozen=True)
class Kind:
    """The motions that a kind of joint leaves free, and those that it locks.

    Attributes:
        name: in problem files.
        slides: axes of the second frame along which the first may not move; None: it may not move at all.
        turns: pairs (i, j): axis i of the first frame stays perpendicular to axis j of the second. A free rotation
            less for each.
        coordinates: what is left. Axes of the second frame come before those of the first.
    """

    name: str
    slides: tuple[int, ...] | None = None
    turns: tuple[tuple[int, int], ...] = ()
    coordinates: tuple[Coordinate, ...] = ()

    @property
    def numbers(self) -> dict[str, Scalar]:
        """Return the numbers of the kind by their keys in problem files; variables may set them."""
        return {key: getattr(self, key) for key in numbers_of(self)}

    def valued(self, numbers: Mapping[str, Scalar]) -> Kind:
        """Return this kind with other ``numbers``."""
        return self

    @property
    def travels(self) -> bool:
        """Whether the points of the frames move apart."""
        return self.slides is not None

    @property
    def screws(self) -> tuple[Coordinate, ...]:
        """Return the coordinates that turn and slide at once; each adds a row that ties displacement to rotation."""
        return tuple(each for each in self.coordinates if each.is_screw)

    @property
    def held(self) -> int:
        """Return the number of locked rows that are displacements; they come first."""
        return 3 if self.slides is None else len(self.slides) + len(self.screws)

    @property
    def locked(self) -> int:
        """Return the number of locked rows."""
        return self.held + len(self.turns)

    @property
    def free(self) -> int:
        """Return the number of free motions, with coordinates or without."""
        return 6 - self.locked

    @property
    def winds(self) -> bool:
        """Whether its coordinates are angles, which count whole turns."""
        return any(coordinate.turns for coordinate in self.coordinates)

    @property
    def turning(self) -> bool:
        """Whether the free motions are rotations, else displacements."""
        return not self.coordinates or self.coordinates[0].turns

    @property
    def quantity(self) -> str:
        """Return the name of the coordinates in formulas, ``angle`` or ``position``."""
        return "angle" if self.turning else "position"

    def axes(self, placed: PlacedFrames) -> Expr:
        """Return the axes of the free motions, unit vectors (3, free), world frame."""
        if not self.coordinates:
            return placed.b[:, : self.free]
        return ca.horzcat(*(each.direction(placed) for each in self.coordinates))

    def motions(self, placed: PlacedFrames) -> list[tuple[Expr, Expr]]:
        """Return S: displacement and rotation (3,) of the first side against the second, for each free motion."""
        if self.coordinates:
            return [each.motion(placed) for each in self.coordinates]
        return [(ca.DM.zeros(3), axis) for axis in ca.horzsplit(self.axes(placed))] if self.free else []

    def rates(self, placed: PlacedFrames, linear: Expr, angular: Expr) -> list[Expr]:
        """Return the rates of the free motions from velocity and angular velocity (3,) of the first side."""
        if self.coordinates:
            return [ca.dot(each.direction(placed), angular if each.turns else linear) for each in self.coordinates]
        return [ca.dot(turn, angular) for _, turn in self.motions(placed)]

    def transform(self, axes: Expr, moved: Expr) -> tuple[Expr, Expr]:
        """Compute X: rotation (4,) and displacement (3,) of the first side as its free motions go on by ``moved``.

        Args:
            axes: (3, free) of the free motions, where the motion begins.
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
        """Return the locked rows, the complement of S, world frame.

        Returns:
            (held, 3) axes along which displacement is locked, None: the world's three; (n, 3) axes about which
            rotation is locked; (held, 3) shares of rotation in the rows of displacement, None: none.
        """
        turns = ca.vertcat(ca.DM(0, 3), *(ca.cross(placed.a[:, i], placed.b[:, j]).T for i, j in self.turns))
        if self.slides is None:
            return None, turns, None
        rows = [placed.b[:, j].T for j in self.slides]
        axes = [each.direction(placed).T for each in self.screws]
        leads = [-each.lead * axis for each, axis in zip(self.screws, axes, strict=True)]
        return ca.vertcat(*rows, *axes), turns, ca.vertcat(ca.DM(len(rows), 3), *leads) if leads else None

    def errors(self, placed: PlacedFrames, near: Expr | None = None) -> Expr:
        """Compute the errors (locked,) of the locked rows [m], [rad].

        ``near``: (k,) coordinates to within half a turn, which tell how often a screw has turned; None: its
        displacement tells.
        """
        if self.slides is None:
            off = placed.apart
        else:
            rows = [ca.dot(placed.b[:, j], placed.apart) for j in self.slides]
            off = ca.vertcat(*rows, *(self._off(k, placed, near) for k in range(len(self.coordinates))))
        return ca.vertcat(off, *(ca.dot(placed.a[:, i], placed.b[:, j]) for i, j in self.turns))

    def _off(self, k: int, placed: PlacedFrames, near: Expr | None) -> Expr:
        """Compute the displacement of a screw less that of its angle (1,) [m]; (0,) for other coordinates."""
        each = self.coordinates[k]
        if not each.is_screw:
            return ca.DM(0, 1)
        along = ca.dot(each.direction(placed), placed.apart)
        about = along * each.lead / (each.lead**2 + TINY) if near is None else near[k]
        return along - each.lead * nearest(each.value(placed), about)
