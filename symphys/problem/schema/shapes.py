"""Tables of shapes: of bodies, of their parts, and of static blocks."""

from __future__ import annotations

from pydantic import Field

from symphys.problem.schema.types import Length, Orientation, Positive, Size, Table, Vector

MOST_PARTS = 1000
UPRIGHT = "quaternion [w, x, y, z], or { roll_deg, pitch_deg, yaw_deg }"


class SphereTable(Table):
    """A sphere about the centre of mass."""

    radius: Positive = Field(description="[m]")
    hollow: bool = Field(
        default=False, description="a thin shell instead of a solid sphere: I = 2/3 m r^2 instead of 2/5"
    )


class BallTable(Table):
    """A solid sphere."""

    radius: Positive = Field(description="[m]")


class BoxTable(Table):
    """A solid box along its own axes."""

    size: Size = Field(description="full length of its edges along x, y and z [m]")


class CapsuleTable(Table):
    """A solid cylinder with round ends, along its own z axis."""

    radius: Positive = Field(description="[m]")
    length: Length = Field(description="of the straight part [m]; end to end it is 2 radii longer")


class PlacedSphereTable(BallTable):
    """One sphere of a compound of spheres."""

    centre: Vector = Field(default=[0.0, 0.0, 0.0], description="[m], from the centre of mass, in the body's frame")


class SolidTable(Table):
    """One of the shapes."""

    sphere: BallTable | None = Field(default=None, description="{ radius = 0.5 }")
    box: BoxTable | None = Field(default=None, description="{ size = [0.2, 0.1, 0.3] }")
    capsule: CapsuleTable | None = Field(default=None, description="{ radius = 0.05, length = 0.3 }")


class PartTable(SolidTable):
    """One part of a compound: a sphere, a box or a capsule, and its place in the body's frame."""

    centre: Vector = Field(default=[0.0, 0.0, 0.0], description="[m], from the centre of mass")
    orientation: Orientation = Field(default=[1.0, 0.0, 0.0, 0.0], description=UPRIGHT)


class ShapeTable(Table):
    """A sphere, a box, a capsule, or a compound of several."""

    sphere: SphereTable | None = Field(default=None, description="{ radius = 0.5 }")
    box: BoxTable | None = Field(default=None, description="{ size = [0.2, 0.1, 0.3] }")
    capsule: CapsuleTable | None = Field(default=None, description="{ radius = 0.05, length = 0.3 }")
    spheres: list[PlacedSphereTable] | None = Field(
        default=None,
        min_length=1,
        max_length=MOST_PARTS,
        description="a compound of spheres: [{ radius = 0.1, centre = [0.2, 0, 0] }, ...]",
    )
    parts: list[PartTable] | None = Field(
        default=None,
        min_length=1,
        max_length=MOST_PARTS,
        description="a compound: [{ box = { size = [0.2, 0.1, 0.3] }, centre = [0.2, 0, 0] }, ...]",
    )
