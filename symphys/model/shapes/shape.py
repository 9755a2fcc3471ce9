"""The interface of every shape of a body: sizes, volume, inertia, contact points, and its forms in other formats.

A new shape is a module beside this one and an entry in ``shapes.SHAPES``; a rule in ``dynamics.collision`` computes
each of its contact pairs. Everything else asks the shape.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from symphys.model.numbers import Number
from symphys.model.scalar import Scalar, is_zero
from symphys.records import dataclass

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
"""The quaternion of no rotation."""
MIN_FLATNESS = 1e-6
"""Least ratio of a shape's smallest size to its largest."""


@dataclass(frozen=True)
class SizeKey:
    """A size as problem files give it, positive [m].

    Attributes:
        name: the key.
        description: for the JSON schema.
        count: 1 for a number, 3 for a list, 0 for a list of points (n, 3), of either sign.
        reason: why it must not be 0, for messages; empty: that goes without saying.
    """

    name: str
    description: str = "radius of the round surface [m]"
    count: int = 1
    reason: str = ""

    def number(self, optional: bool) -> Number:
        """Return what is known of it; an optional size may be 0."""
        return Number("m", least=0.0, exceeds=not optional)


@dataclass(frozen=True)
class RoundedHull:
    """The points within a radius of the convex hull of some corners.

    A sphere has one corner, a capsule two. A polytope has radius 0. A curved surface is approximated by many corners.

    Attributes:
        radius: [m].
        corners: (k, 3) [m], from the centre of mass of the shape, along its own axes. None lies between others.
    """

    radius: float
    corners: tuple[tuple[float, float, float], ...]


class SolidShape(ABC):
    """A solid, placed in a body's frame or in the world.

    Attributes:
        kind: its key in problem files and in scene.json, and its type in MJCF.
        plural: for messages.
        summary: one sentence for the JSON schema.
        example: its table in a problem file.
        size_keys: its sizes as problem files give them.
        optional_keys: lengths that are 0 unless they are given.
        contact_points: in how many points it may touch another surface at once, by the kind of that; a pair of kinds
            may be stated by either of the two.
        turns: whether a turn about its centre changes it.
        centre: (3,) [m].
    """

    kind: ClassVar[str]
    plural: ClassVar[str]
    summary: ClassVar[str]
    example: ClassVar[str]
    size_keys: ClassVar[tuple[SizeKey, ...]]
    optional_keys: ClassVar[tuple[SizeKey, ...]] = ()
    contact_points: ClassVar[Mapping[str, int]]
    turns: ClassVar[bool] = True
    centre: tuple[Scalar, ...]

    @classmethod
    @abstractmethod
    def from_sizes(cls, sizes: Mapping[str, Any], centre: tuple[Scalar, ...], orientation: tuple[Scalar, ...]) -> Self:
        """The shape with these ``sizes``; see there."""

    @property
    @abstractmethod
    def sizes(self) -> dict[str, Any]:
        """Return sizes [m] by the names of ``size_keys``: a number, three, or points; optional ones if not 0."""

    @property
    @abstractmethod
    def volume(self) -> Scalar:
        """Volume [m^3]."""

    @property
    @abstractmethod
    def moments(self) -> tuple[Scalar, Scalar, Scalar]:
        """Moments of inertia about its own centre of mass, along its own axes, by mass [m^2]."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """Distance from its centre to its farthest point [m]."""

    @property
    @abstractmethod
    def rounded_hull(self) -> RoundedHull:
        """Return the outline that pictures draw."""

    @property
    @abstractmethod
    def mjcf_size(self) -> tuple[Scalar, ...]:
        """``size`` of a MuJoCo geom whose type is ``kind``."""

    @property
    def products(self) -> tuple[Scalar, Scalar, Scalar]:
        """Entries yz, xz and xy of its tensor of inertia, beside ``moments`` [m^2]: 0 along principal axes."""
        return 0.0, 0.0, 0.0

    @property
    def centroid(self) -> tuple[Scalar, ...]:
        """(3,): its centre of mass from ``centre``, along its own axes [m]."""
        return (0.0, 0.0, 0.0)

    @property
    def parameters(self) -> dict[str, Any]:
        """The ``sizes`` that variables may set."""
        return self.sizes

    @property
    def numbers(self) -> dict[str, Number]:
        """Return what is known of each of the ``parameters``."""
        optional = {each.name for each in self.optional_keys}
        keys = {each.name: each for each in (*self.size_keys, *self.optional_keys)}
        return {name: keys[name].number(name in optional) for name in self.parameters}

    @property
    def flatness(self) -> str:
        """Return the reason why it is too flat or thin to have a volume; empty if it is not."""
        return ""

    @property
    def optional_fault(self) -> str:
        """Return the reason why one of the ``optional_keys`` is impossible; empty if none is."""
        return ""

    @property
    def orientation(self) -> tuple[Scalar, ...]:
        """(4,): unit quaternion w x y z; no rotation where a turn changes nothing."""
        return UPRIGHT

    @property
    def central(self) -> bool:
        """Whether it is a ball about the origin: whatever touches it acts through there, and no turn changes it."""
        return not self.turns and all(is_zero(c) for c in self.centre)

    @property
    def placement(self) -> dict[str, tuple[Scalar, ...]]:
        """``centre`` and, unless a turn changes nothing, ``orientation``."""
        return {"centre": self.centre} | ({"orientation": self.orientation} if self.turns else {})

    def resized(self, sizes: Mapping[str, Any]) -> Self:
        """The shape with other ``sizes``, in its place."""
        return self.from_sizes(sizes, self.centre, self.orientation)
