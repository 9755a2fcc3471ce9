"""Joints as scene.json has them: frozen records, and their reading."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from symphys.findings import values
from symphys.results.records import Array


@dataclass(frozen=True)
class SceneSocket:
    """Where a joint is on one side, in the frame of the body or the world: ``point`` (3,) [m], ``orientation`` (4,)."""

    point: Array = field(default_factory=lambda: np.zeros(3))
    orientation: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass(frozen=True)
class SceneMotor:
    """A motor: its kind as in problem files, its largest torque [N m] or [N], its largest speed [rad/s] or [m/s]."""

    kind: str
    torque: float = np.nan
    velocity: float = np.nan


@dataclass(frozen=True)
class SceneJoint:
    """What holds two bodies together, or a body to the world.

    Attributes:
        name, kind: as in the problem file.
        first, second: names of bodies; ``second`` is empty for the world.
        sockets: of the first and of the second.
        turns: for each coordinate whether it is an angle [rad], else a displacement [m].
        lower, upper: bounds of every coordinate; infinite where there is none.
        motor: None if nothing drives it.
    """

    name: str
    kind: str = ""
    first: str = ""
    second: str = ""
    sockets: tuple[SceneSocket, SceneSocket] = (SceneSocket(), SceneSocket())
    turns: tuple[bool, ...] = ()
    lower: float = -np.inf
    upper: float = np.inf
    motor: SceneMotor | None = None

    @property
    def bodies(self) -> tuple[str, ...]:
        """The names of those that it holds."""
        return tuple(name for name in (self.first, self.second) if name)


def make_joints(entries: object) -> Iterator[SceneJoint]:
    """The joints of scene.json; those without a name, a body and two sockets are left out."""
    for entry in values.tables(entries):
        sockets = tuple(make_socket(each) for each in values.tables(entry.get("sockets")))
        name, first = values.name(entry.get("name")), values.name(entry.get("first"))
        if not (name and first) or len(sockets) != 2 or None in sockets:
            continue
        limits = values.numbers(entry.get("limits"))
        lower, upper = limits if limits.size == 2 else (np.nan, np.nan)
        yield SceneJoint(
            name=name,
            kind=values.name(entry.get("kind")),
            first=first,
            second=values.name(entry.get("second")),
            sockets=(sockets[0] or SceneSocket(), sockets[1] or SceneSocket()),
            turns=tuple(each.get("turns") is True for each in values.tables(entry.get("coordinates"))),
            lower=-np.inf if np.isnan(lower) else float(lower),
            upper=np.inf if np.isnan(upper) else float(upper),
            motor=make_motor(entry.get("motor")),
        )


def make_socket(entry: dict[str, object]) -> SceneSocket | None:
    """One side; None if its place is not finite or its orientation none."""
    point, orientation = values.numbers(entry.get("point")), values.numbers(entry.get("orientation"))
    length = float(np.linalg.norm(orientation))
    if point.size != 3 or orientation.size != 4 or not np.isfinite(point).all() or not 0 < length < np.inf:
        return None
    return SceneSocket(point, orientation / length)


def make_motor(entry: object) -> SceneMotor | None:
    """A motor; None for no table."""
    told = values.table(entry)
    if not told:
        return None
    return SceneMotor(
        values.name(told.get("kind")), values.number(told.get("torque")), values.number(told.get("velocity"))
    )
