"""Joints of scene.json: frozen records, their writing and their reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, field
from typing import Any

import numpy as np

from symphys import json_values as values
from symphys.json_values import Text
from symphys.records import dataclass
from symphys.types import Array

AXES = {"hinge": ((0, 0),), "slider": ((1, 0),), "universal": ((1, 1), (0, 0))}
"""``SceneJoint.axes`` by the kind of joint, for files without them."""


@dataclass(frozen=True)
class SceneJointFrame:
    """The frame of a joint on one side, in that of the body or the world: ``point`` (3,) [m], ``orientation`` (4,)."""

    point: Array = field(default_factory=lambda: np.zeros(3))
    orientation: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``sockets``."""
        return {"point": self.point.tolist(), "orientation": self.orientation.tolist()}

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> SceneJointFrame | None:
        """Read one side; None if its place is not finite or its orientation none."""
        read = values.record(cls, {"point": None, "orientation": None, **values.table(value)}, text)
        length = float(np.linalg.norm(read.orientation))
        if read.point.size != 3 or not np.isfinite(read.point).all():
            return None
        return (
            cls(read.point, read.orientation / length) if read.orientation.size == 4 and 0 < length < np.inf else None
        )


@dataclass(frozen=True)
class SceneCoordinate:
    """A coordinate of a joint.

    Attributes:
        name: ``angle`` or ``position``; with a number where there are two.
        turns: whether it is an angle [rad], else a displacement [m].
        side, axis: which side's frame carries its axis, and which of that frame's axes it is; -1 in files without.
    """

    name: str
    turns: bool
    side: int = -1
    axis: int = -1


@dataclass(frozen=True)
class SceneMotor:
    """A motor: its kind as in problem files, and its known numbers, in SI units, by their keys."""

    kind: str
    numbers: Mapping[str, float] = field(default_factory=dict)

    @property
    def torque(self) -> float:
        """The largest torque [N m] or force [N]; nan where unknown."""
        return self.numbers.get("torque", np.nan)

    @property
    def velocity(self) -> float:
        """The largest speed [rad/s] or [m/s]; nan where unknown."""
        return self.numbers.get("velocity", np.nan)

    def to_json(self) -> dict[str, Any]:
        """Return the ``motor`` of a joint."""
        return {"kind": self.kind, **self.numbers}

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> SceneMotor | None:
        """Read a motor; None for no table."""
        entry = values.table(value)
        numbers = {key: values.number(number) for key, number in entry.items() if key != "kind"}
        return cls(text(entry.get("kind")), numbers) if entry else None


@dataclass(frozen=True)
class SceneJoint:
    """A joint between two bodies, or a body and the world; coordinates are those of the first against the second.

    Attributes:
        name, kind: as in the problem file.
        first, second: names of bodies; ``second`` is empty for the world, which is null in the file.
        frames: of the first and of the second, ``sockets`` in the file.
        coordinates: in the order of the joint's values.
        lower, upper: bounds of every coordinate, ``limits`` in the file; infinite where there is none, which is null.
        motor: None if nothing drives it.
    """

    name: str
    kind: str = ""
    first: str = ""
    second: str = ""
    frames: tuple[SceneJointFrame, ...] = field(
        default=(SceneJointFrame(), SceneJointFrame()), metadata={"key": "sockets"}
    )
    coordinates: tuple[SceneCoordinate, ...] = ()
    lower: float = -np.inf
    upper: float = np.inf
    motor: SceneMotor | None = None

    @property
    def bodies(self) -> tuple[str, ...]:
        """The names of the connected bodies."""
        return tuple(name for name in (self.first, self.second) if name)

    @property
    def turns(self) -> tuple[bool, ...]:
        """Return for each coordinate whether it is an angle."""
        return tuple(coordinate.turns for coordinate in self.coordinates)

    @property
    def axes(self) -> tuple[tuple[int, int], ...]:
        """Return for each coordinate the side whose frame carries its axis, and which axis of it that is."""
        known = tuple((each.side, each.axis) for each in self.coordinates)
        whole = all(0 <= side < 2 and 0 <= axis < 3 for side, axis in known)
        return known if known and whole else AXES.get(self.kind, ())

    @property
    def rotates(self) -> bool:
        """Whether a rotation is free."""
        return any(self.turns) or not (self.turns or self.kind == "fixed")

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``joints``."""
        return {
            "name": self.name,
            "kind": self.kind,
            "first": self.first,
            "second": self.second or None,
            "sockets": [frame.to_json() for frame in self.frames],
            "coordinates": [asdict(each) for each in self.coordinates],
            "limits": [bound if np.isfinite(bound) else None for bound in (self.lower, self.upper)],
            "motor": None if self.motor is None else self.motor.to_json(),
        }

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> SceneJoint | None:
        """Read a joint; None for one without a name, a body and two frames."""
        entry = values.table(value)
        limits = values.numbers(entry.get("limits"))
        lower, upper = limits if limits.size == 2 else (np.nan, np.nan)
        read = values.record(
            cls,
            {"sockets": None, **entry},
            text,
            lower=-np.inf if np.isnan(lower) else float(lower),
            upper=np.inf if np.isnan(upper) else float(upper),
            motor=SceneMotor.from_json(entry.get("motor")),
        )
        whole = len(read.frames) == len(values.tables(entry.get("sockets"))) == 2
        return read if read.name and read.first and whole else None
