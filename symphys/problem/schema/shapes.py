"""Tables of shapes: of bodies, of their parts, and of static blocks; a key for each of ``SHAPES``."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, PlainValidator, WithJsonSchema, create_model

from symphys.model.shapes import SHAPES, SizeKey, Sphere
from symphys.problem.reading.messages import listed
from symphys.problem.schema import checks
from symphys.problem.schema.types import NonNegative, Orientation, Points, Positive, SchemaTable, Size, Vector

MAX_PARTS = 1000
EXAMPLES = listed([f"{{ {kind} = {shape.example} }}" for kind, shape in SHAPES.items()], "or")
"""A table of each shape."""
UPRIGHT = "quaternion [w, x, y, z], or { roll_deg, pitch_deg, yaw_deg }"


def value_of(key: SizeKey) -> Any:
    """The kind of value of a size."""
    if key.count != 1:
        return Size if key.count == 3 else Points
    if not key.reason:
        return Positive
    return Annotated[
        float,
        PlainValidator(checks.positive_number(key.reason)),
        WithJsonSchema({"type": "number", "exclusiveMinimum": 0}),
    ]


def one_of_the_shapes() -> type[SchemaTable]:
    """A table with an optional table of sizes for each shape."""
    fields: dict[str, Any] = {}
    for kind, shape in SHAPES.items():
        sizes: dict[str, Any] = {k.name: (value_of(k), Field(description=k.description)) for k in shape.size_keys}
        sizes |= {k.name: (NonNegative, Field(default=0.0, description=k.description)) for k in shape.optional_keys}
        name = f"Solid{kind.capitalize()}Table"
        table = create_model(name, __base__=SchemaTable, __doc__=shape.summary, __module__=__name__, **sizes)
        fields[kind] = (table | None, Field(default=None, description=shape.example))
    return create_model("OneShapeTable", __base__=SchemaTable, __module__=__name__, **fields)


class SolidTable(one_of_the_shapes()):  # type: ignore[misc]
    """One of the shapes."""


class PartTable(SolidTable):
    """One part of a compound: a shape and its pose in the body's frame."""

    centre: Vector = Field(default=[0.0, 0.0, 0.0], description="position of the part in the body's frame [m]")
    orientation: Orientation = Field(default=[1.0, 0.0, 0.0, 0.0], description=UPRIGHT)


class PlacedSphereTable(SchemaTable):
    """One sphere of a compound of spheres."""

    radius: Positive = Field(description="radius of the sphere [m]")
    centre: Vector = Field(default=[0.0, 0.0, 0.0], description="position of the sphere in the body's frame [m]")


class SphereTable(SchemaTable):
    """A sphere about the centre of mass."""

    radius: Positive = Field(description="radius of the sphere [m]")
    hollow: bool = Field(default=False, description="a thin shell, I = 2/3 m r^2, instead of a solid sphere, 2/5 m r^2")


class ShapeTable(SolidTable):
    """A shape, or a compound of several."""

    sphere: SphereTable | None = Field(default=None, description=Sphere.example)
    spheres: list[PlacedSphereTable] | None = Field(
        default=None,
        min_length=1,
        max_length=MAX_PARTS,
        description="compound of spheres: [{ radius = 0.1, centre = [0.2, 0, 0] }, ...]",
    )
    parts: list[PartTable] | None = Field(
        default=None,
        min_length=1,
        max_length=MAX_PARTS,
        description="compound: [{ box = { size = [0.2, 0.1, 0.3] }, centre = [0.2, 0, 0] }, ...]",
    )
