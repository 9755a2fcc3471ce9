"""A rigid body, and sites: frames on bodies or in the world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from math import inf
from typing import Any, ClassVar, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
from symphys.model.numbers import table_key
from symphys.model.orientation import unit_quaternion
from symphys.model.scalar import Scalar, is_zero
from symphys.model.shapes import SOLID_SPHERE, UPRIGHT, Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from symphys.model.shapes.inertia import centring, inertia_of, off_centre, specific
from symphys.records import dataclass
from symphys.suggest import hint, quote

HOLLOW_SPHERE = 2 / 3
"""Of a thin spherical shell: moment of inertia by mass and squared radius."""
Vector = Sequence[float] | NDArray[np.float64]


class BodyStart(TypedDict, total=False):
    """The start of a body's motion, in world coordinates; missing values are zero, and upright.

    Attributes:
        position: (3,) of the centre of mass [m].
        orientation: quaternion w x y z of any length, or ``{"roll_deg": 0, "pitch_deg": 0, "yaw_deg": 30}``.
        velocity: (3,) [m/s].
        angular_velocity: (3,) [rad/s].
    """

    position: Vector
    orientation: Vector | Mapping[str, float]
    velocity: Vector
    angular_velocity: Vector


@dataclass(frozen=True)
class Body:
    """A rigid body.

    Attributes:
        name: how states, inputs and parameters refer to it.
        mass: [kg]; 0 is a frame between two joints, without inertia and shapes.
        inertia: about the centre of mass [kg m^2]: a scalar (the same about every axis),
            (3,) principal moments along the body's axes, or a symmetric (3, 3) tensor, body frame.
        shapes: the parts of its surface.
        start: where a motion begins; see ``BodyStart``. No part of the physics: two bodies that differ in it are equal.

    Raises:
        SymphysError: names the body and what would be valid.

    Example:
        >>> from symphys.model import Body
        >>> crate = Body.box("crate", size=(0.4, 0.3, 0.2), density=500, position=(0, 0, 1))
        >>> round(crate.mass, 9), [round(moment, 9) for moment in crate.inertia]
        (12.0, [0.13, 0.2, 0.25])
    """

    name: str
    mass: Scalar
    inertia: Scalar
    shapes: tuple[Shape, ...] = ()
    start: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Check the start."""
        if self.start:
            object.__setattr__(self, "start", _checked_start(self.name, self.start))

    @classmethod
    def frame(cls, name: str, **start: Unpack[BodyStart]) -> Body:
        """A body without mass between two joints, so that two bodies may have several joints between them."""
        return cls(name, 0.0, 0.0, (), dict(start))

    @property
    def massless(self) -> bool:
        """Whether it is a frame between two joints; a matter of structure, so never a symbol's value."""
        return is_zero(self.mass)

    @classmethod
    def ball(
        cls,
        name: str,
        radius: Scalar,
        mass: Scalar = None,
        hollow: bool = False,
        *,
        density: Scalar = None,
        **start: Unpack[BodyStart],
    ) -> Body:
        """A uniform solid sphere, or a thin hollow one: I = 2/5 m r^2 or 2/3 m r^2.

        Args:
            name: of the body.
            radius: [m].
            mass: [kg]; or ``density``, of a solid sphere.
            hollow: whether it is a thin shell.
            density: [kg/m^3].
            start: see ``BodyStart``.
        """
        if hollow and density is not None:
            raise _refused(name, "a hollow sphere is a thin shell without volume; give mass, not density")
        share = HOLLOW_SPHERE if hollow else SOLID_SPHERE
        shape = _solid(name, Sphere, radius=radius)
        mass = _mass(name, mass, density, (shape,))
        return cls(name, mass, share * mass * radius * radius, (shape,), dict(start))

    @classmethod
    def box(
        cls,
        name: str,
        size: Sequence[Scalar],
        mass: Scalar = None,
        *,
        density: Scalar = None,
        edge: Scalar = 0.0,
        **start: Unpack[BodyStart],
    ) -> Body:
        """A uniform box; ``size``: the full lengths of its edges along x, y and z [m]; ``edge``: their radius [m].

        See ``ball`` and ``Box``.
        """
        return cls._of(name, (_solid(name, Box, size=size, edge=edge),), mass, density, start)

    @classmethod
    def capsule(
        cls,
        name: str,
        radius: Scalar,
        length: Scalar,
        mass: Scalar = None,
        *,
        density: Scalar = None,
        **start: Unpack[BodyStart],
    ) -> Body:
        """A uniform capsule along its z axis; ``length``: of the straight part [m]. See ``ball``."""
        return cls._of(name, (_solid(name, Capsule, radius=radius, length=length),), mass, density, start)

    @classmethod
    def cylinder(
        cls,
        name: str,
        radius: Scalar,
        length: Scalar,
        mass: Scalar = None,
        *,
        density: Scalar = None,
        **start: Unpack[BodyStart],
    ) -> Body:
        """A uniform cylinder along its z axis; ``length``: from end to end [m]. See ``ball``."""
        return cls._of(name, (_solid(name, Cylinder, radius=radius, length=length),), mass, density, start)

    @classmethod
    def ellipsoid(
        cls,
        name: str,
        radii: Sequence[Scalar],
        mass: Scalar = None,
        *,
        density: Scalar = None,
        **start: Unpack[BodyStart],
    ) -> Body:
        """A uniform ellipsoid; ``radii``: half axes along x, y and z [m]. See ``ball``."""
        return cls._of(name, (_solid(name, Ellipsoid, radii=radii),), mass, density, start)

    @classmethod
    def compound(
        cls,
        name: str,
        shapes: Sequence[Shape],
        mass: Scalar = None,
        *,
        density: Scalar = None,
        **start: Unpack[BodyStart],
    ) -> Body:
        """Solid shapes of equal density, in one piece; where they overlap counts twice. See ``ball``.

        Args:
            name: of the body.
            shapes: placed in the body's frame, whose origin must be their centre of mass.
            mass: [kg]; or ``density``.
            density: [kg/m^3].
            start: see ``BodyStart``.
        """
        shapes = tuple(shapes)
        if not shapes:
            raise _refused(name, "a compound needs shapes, such as Sphere(0.1, centre=(0.2, 0, 0))")
        if all(_plain(c) for shape in shapes for c in (*shape.centre, shape.volume)) and off_centre(shapes):
            raise _refused(name, centring(shapes, "shapes"))
        return cls._of(name, shapes, mass, density, start)

    @classmethod
    def _of(cls, name: str, shapes: tuple[Shape, ...], mass: Scalar, density: Scalar, start: BodyStart) -> Body:
        mass = _mass(name, mass, density, shapes)
        return cls(name, mass, inertia_of(specific(shapes), mass), shapes, dict(start))


def _solid(name: str, kind: type[Shape], **sizes: Any) -> Shape:
    """A shape about the body's origin; SymphysError for sizes that are none."""
    for key in kind.size_keys:
        given = [*sizes[key.name]] if isinstance(sizes[key.name], Sequence | np.ndarray) else [sizes[key.name]]
        if len(given) != key.count or not all(_positive(value) for value in given):
            wanted = "a positive length [m]" if key.count == 1 else f"{key.count} positive lengths [m]"
            raise _refused(name, f"{key.name} must be {wanted}, not {sizes[key.name]}")
    shape = kind.from_sizes(sizes, (0.0, 0.0, 0.0), UPRIGHT)
    if _plain(shape.volume) and shape.flatness:
        raise _refused(name, shape.flatness)
    if shape.optional_fault:
        raise _refused(name, shape.optional_fault)
    return shape


def _mass(name: str, mass: Scalar, density: Scalar, shapes: Sequence[Shape]) -> Scalar:
    """The one that is given, or that follows from the density."""
    if (mass is None) == (density is None):
        raise _refused(name, "give either mass [kg] or density [kg/m^3]")
    key, value = ("mass", mass) if density is None else ("density", density)
    if not _positive(value):
        raise _refused(name, f"{key} must be positive, not {value}")
    return mass if density is None else density * sum(shape.volume for shape in shapes)


def _positive(value: Any) -> bool:
    """Whether it is a positive number, or a symbol."""
    return 0 < value < inf if _plain(value) else hasattr(value, "is_zero")


def _plain(value: Any) -> bool:
    """Whether it is a number, no symbol."""
    return isinstance(value, int | float | np.number)


def _checked_start(name: str, start: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """Plain numbers by the keys of ``BodyStart``, the orientation of length 1."""
    found = {}
    for key, given in start.items():
        if key not in BodyStart.__annotations__:
            raise _refused(name, f"the start has no {quote(key)}; {hint(key, BodyStart.__annotations__)}")
        count = 4 if key == "orientation" else 3
        try:
            value = unit_quaternion(given) if key == "orientation" else np.array(given, float)
        except (TypeError, ValueError) as error:
            if "CasADi" in str(error):
                text = f"{key} must be plain numbers; symbols go into initial_state(world, {{...}})"
                raise _refused(name, text) from None
            raise _refused(name, f"{key}: {error}") from None
        if value.shape != (count,) or not np.isfinite(value).all():
            raise _refused(name, f"{key} must be {count} numbers, not {given}")
        found[key] = tuple(value.tolist())
    return found


def _refused(name: str, text: str) -> SymphysError:
    """The error about a body."""
    return SymphysError(f"body {quote(name)}: {text}")


@dataclass(frozen=True)
class SiteMotor:
    """A force and a torque on a body in proportion to a command, as of a rotor or a thruster.

    Attributes:
        force: (3,) [N] at the site for a command of 1, along the site's axes.
        torque: (3,) [N m] likewise; a rotor's drag is some centimetres times its thrust.
        command_range: least and largest command; None: any.
    """

    example: ClassVar[str] = "{ force = [0, 0, 1], torque = [0, 0, 0.02], command_range = [0, 5] }"

    force: tuple[float, ...] = field(
        default=(0.0, 0.0, 0.0), metadata=table_key("direction", "at command 1, along the site's axes [N]")
    )
    torque: tuple[float, ...] = field(
        default=(0.0, 0.0, 0.0), metadata=table_key("direction", "at command 1, along the site's axes [N m]")
    )
    command_range: tuple[float, float] | None = field(
        default=None, metadata=table_key("ends", "least and largest command; default: any")
    )


@dataclass(frozen=True)
class Site:
    """A point with axes that is fixed in a body, or in the world.

    Attributes:
        name: formulas name ``<site>.position`` (3,) [m], ``.orientation`` (4,) and ``.velocity`` (3,) [m/s].
        body: its index; None: the world.
        position: (3,) from the centre of mass, body frame [m]; of the world: world frame.
        orientation: (4,) unit quaternion w x y z from the site's axes to the body's, or the world's.
        motor: what acts on the body there; its command is the input ``<site>.command``.
    """

    name: str
    body: int | None
    position: Sequence[Any] = (0.0, 0.0, 0.0)
    orientation: Sequence[Any] = (1.0, 0.0, 0.0, 0.0)
    motor: SiteMotor | None = None
