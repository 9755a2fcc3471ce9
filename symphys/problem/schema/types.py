"""Kinds of values in a problem file: strict, so that no text and no true or false passes as a number."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, PlainValidator, Tag, WithJsonSchema

from symphys.problem.schema import checks


class SchemaTable(BaseModel):
    """A table of the file: unknown keys are errors, values are taken as they are written."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)


def deprecated(name: str) -> Any:
    """The field of an optional key that has a new name; ``check_twice`` refuses both."""
    return Field(default=None, description=f"old name of {name}", json_schema_extra={"deprecated": True})


def vector_schema(count: int) -> dict[str, Any]:
    """The JSON Schema of a list of ``count`` numbers."""
    return {"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count}


def coefficient_schema() -> dict[str, Any]:
    """The JSON Schema of a number of at least 0."""
    return {"type": "number", "minimum": 0}


def positive_schema(count: int) -> dict[str, Any]:
    """The JSON Schema of a list of ``count`` positive numbers."""
    return {
        "type": "array",
        "items": {"type": "number", "exclusiveMinimum": 0},
        "minItems": count,
        "maxItems": count,
    }


def coordinates_schema() -> dict[str, Any]:
    """The JSON Schema of a number or a list of numbers."""
    number = {"type": "number"}
    return {"anyOf": [number, {"type": "array", "items": number, "minItems": 1}]}


def numbers_schema() -> dict[str, Any]:
    """The JSON Schema of a number, a list of numbers or a list of lists of numbers."""
    number = {"type": "number"}
    flat = {"type": "array", "items": number, "minItems": 1}
    nested_rows = {"type": "array", "items": flat, "minItems": 1}
    return {"anyOf": [number, flat, nested_rows]}


def stages_schema() -> dict[str, Any]:
    """The JSON Schema of a number of at least 0, or a list of them."""
    number = coefficient_schema()
    return {"anyOf": [number, {"type": "array", "items": number, "minItems": 1}]}


NestedList = float | list[float] | list[list[float]]

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
NonZero = Annotated[
    float,
    PlainValidator(checks.nonzero),
    WithJsonSchema({"type": "number", "not": {"const": 0}}),
]
Vector = Annotated[list[float], PlainValidator(checks.vector(3)), WithJsonSchema(vector_schema(3))]
Pair = Annotated[list[float], PlainValidator(checks.vector(2)), WithJsonSchema(vector_schema(2))]
Ends = Annotated[list[float], PlainValidator(checks.ends), WithJsonSchema(vector_schema(2))]
Coordinates = Annotated[list[float], PlainValidator(checks.coordinates), WithJsonSchema(coordinates_schema())]
Size = Annotated[list[float], PlainValidator(checks.positive(3)), WithJsonSchema(positive_schema(3))]
Spacing = Annotated[
    list[float],
    PlainValidator(checks.spacing),
    WithJsonSchema({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, positive_schema(2)]}),
]
Grid = Annotated[
    list[list[float]],
    PlainValidator(checks.grid),
    WithJsonSchema(
        {
            "type": "array",
            "items": {"type": "array", "items": {"type": "number"}, "minItems": checks.MIN_GRID_SIDE},
            "minItems": checks.MIN_GRID_SIDE,
        }
    ),
]
Points = Annotated[
    list[list[float]],
    PlainValidator(checks.points),
    WithJsonSchema(
        {
            "type": "array",
            "items": vector_schema(3),
            "minItems": checks.LEAST_POINTS,
            "maxItems": checks.MOST_POINTS,
        }
    ),
]
Quaternion = Annotated[list[float], PlainValidator(checks.vector(4)), WithJsonSchema(vector_schema(4))]
Numbers = Annotated[NestedList, PlainValidator(checks.nested(bound=False)), WithJsonSchema(numbers_schema())]
Bounds = Annotated[NestedList, PlainValidator(checks.nested(bound=True)), WithJsonSchema(numbers_schema())]
Identifier = Annotated[
    str,
    PlainValidator(checks.identifier),
    WithJsonSchema({"type": "string", "pattern": f"^{checks.IDENTIFIER}$", "maxLength": checks.MAX_IDENTIFIER}),
]
Label = Annotated[
    str, PlainValidator(checks.label), WithJsonSchema({"type": "string", "minLength": 1, "maxLength": checks.MAX_LABEL})
]
PHASE = {"type": "string", "pattern": f"^{checks.OF_PHASE}$", "examples": ["end of flight"]}
Moment = Annotated[
    str | float,
    PlainValidator(checks.moment),
    WithJsonSchema({"anyOf": [{"enum": ["end", "always"]}, {"type": "number", "minimum": 0}, PHASE]}),
]
Instant = Annotated[
    str | float,
    PlainValidator(checks.instant),
    WithJsonSchema({"anyOf": [{"const": "end"}, {"type": "number", "minimum": 0}, PHASE]}),
]
Inertia = Annotated[NestedList, PlainValidator(checks.inertia), WithJsonSchema(numbers_schema())]
Texts = Annotated[
    list[str],
    PlainValidator(checks.texts),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]}),
]
Prior = Annotated[
    list[list[float]],
    PlainValidator(checks.prior),
    WithJsonSchema({"type": "array", "items": coordinates_schema(), "minItems": 2, "maxItems": 2}),
]
Smoothing = Annotated[list[float], PlainValidator(checks.smoothing), WithJsonSchema(stages_schema())]
Friction = Annotated[
    float | tuple[float, float],
    PlainValidator(checks.friction),
    WithJsonSchema({"anyOf": [coefficient_schema(), {**vector_schema(2), "items": coefficient_schema()}]}),
]
Direction = Annotated[tuple[float, ...], PlainValidator(checks.direction), WithJsonSchema(vector_schema(3))]
Interpolation = Literal["constant", "linear"]
Stop = Literal["met", "converged"]


class RollPitchYaw(SchemaTable):
    """Rotations about the fixed world axes, in this order."""

    roll_deg: Finite = Field(default=0.0, description="about x [degrees]")
    pitch_deg: Finite = Field(default=0.0, description="about y [degrees]")
    yaw_deg: Finite = Field(default=0.0, description="about z [degrees]")


Orientation = Annotated[
    Annotated[Quaternion, Tag("<quaternion>")] | Annotated[RollPitchYaw, Tag("<angles>")],
    Discriminator(lambda value: "<angles>" if isinstance(value, dict | RollPitchYaw) else "<quaternion>"),
]
