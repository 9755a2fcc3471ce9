"""A helical joint (a screw): the first side turns about the x axis of the frames and moves along it, a pitch a turn.

Its coordinate is the angle. S = (axis, h axis) with h = pitch / 2 pi: what acts along the coordinate is a torque, whose
share pitch / 2 pi of force a nut pushes with.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from math import isfinite, pi
from typing import Any, ClassVar

from symphys.model.joints.hinge import angle
from symphys.model.joints.kind import Coordinate, Kind
from symphys.model.joints.specs import SingleAxisJoint
from symphys.model.numbers import declare
from symphys.model.scalar import Scalar
from symphys.records import dataclass
from symphys.types import Array


@dataclass(frozen=True)
class HelicalKind(Kind):
    """The kind of a screw with a ``pitch``: displacement in a turn [m], negative for a left-hand thread."""

    pitch: Scalar = field(default=0.0, metadata=declare("m"))

    def valued(self, numbers: Mapping[str, Scalar]) -> Kind:
        """Return the kind of another pitch."""
        return helical(numbers["pitch"])


def helical(pitch: Scalar) -> HelicalKind:
    """Make the kind of screws with this pitch [m], which is not 0."""
    turn = Coordinate("angle", angle, lead=pitch / (2 * pi))
    return HelicalKind("helical", (1, 2), ((0, 1), (0, 2)), (turn,), pitch)


@dataclass(frozen=True)
class HelicalJoint(SingleAxisJoint):
    """The second turns about an axis and moves along it as it does.

    Attributes:
        axis: (3,) of any length but 0, as the bodies lie, world coordinates.
        pitch: displacement along the axis in a turn [m]; negative for a left-hand thread, not 0.

    Example:
        >>> from symphys import Problem, simulate
        >>> from symphys.model import Body, HelicalJoint, TorqueMotor, make_world
        >>> nut = Body.cylinder("nut", radius=0.02, length=0.02, mass=0.2)
        >>> screw = HelicalJoint("screw", ("world", "nut"), axis=(0, 0, 1), pitch=0.005, point=(0, 0, 0), start=6.0)
        >>> motion = simulate(Problem.from_world(make_world([nut], joints=[screw]), duration=0.1))
        >>> turns = (motion["screw.angle"][-1] - motion["screw.angle"][0]) / 6.283185307179586
        >>> bool(abs(motion["nut.position"][-1][2] - motion["nut.position"][0][2] - 0.005 * turns) < 1e-12)
        True
    """

    summary: ClassVar[str] = "turns about an axis and moves along it"
    example: ClassVar[str] = "{ axis = [0, 0, 1], pitch = 0.005 }"

    pitch: Scalar = field(
        kw_only=True,
        metadata=declare("m", "travel along the axis in one turn; negative for a left-hand thread", "nonzero"),
    )

    @property
    def kind(self) -> Kind:
        """Return the kind of joint."""
        return helical(self.pitch)

    def check_acting(self) -> None:
        """Raise ValueError for a pitch, a motor or a spring that is none."""
        if isinstance(self.pitch, int | float) and not (self.pitch and isfinite(self.pitch)):
            raise ValueError(f"pitch must be a number but 0 [m], not {self.pitch}")
        super().check_acting()

    @classmethod
    def table(cls, kind: Kind, axes: Array) -> dict[str, Any]:
        """Return the keys of its table in problem files."""
        return {**super().table(kind, axes), "pitch": float(kind.numbers["pitch"])}
