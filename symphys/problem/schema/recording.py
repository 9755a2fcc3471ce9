"""Tables of measured motions, and of how parameters are identified from them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import pi
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, PlainValidator, Tag, WithJsonSchema

from symphys.problem.schema import checks
from symphys.problem.schema.types import (
    Finite,
    Identifier,
    Interpolation,
    Label,
    Orientation,
    Positive,
    SchemaTable,
    Texts,
    Vector,
)

CONVERSIONS: dict[str, tuple[float, str]] = {
    "m": (1.0, "m"),
    "cm": (0.01, "m"),
    "mm": (0.001, "m"),
    "in": (0.0254, "m"),
    "ft": (0.3048, "m"),
    "m/s": (1.0, "m/s"),
    "cm/s": (0.01, "m/s"),
    "mm/s": (0.001, "m/s"),
    "km/h": (1 / 3.6, "m/s"),
    "rad": (1.0, "rad"),
    "deg": (pi / 180, "rad"),
    "rad/s": (1.0, "rad/s"),
    "deg/s": (pi / 180, "rad/s"),
    "rpm": (pi / 30, "rad/s"),
    "m/s^2": (1.0, "m/s^2"),
    "g": (9.80665, "m/s^2"),
    "N": (1.0, "N"),
    "kN": (1000.0, "N"),
    "N m": (1.0, "N m"),
    "N mm": (0.001, "N m"),
}
"""By units of columns the factors to units of the engine, and these. ``g`` is that of free fall, no gram."""
Unit = Annotated[
    str, PlainValidator(checks.one_of(CONVERSIONS)), WithJsonSchema({"type": "string", "enum": [*CONVERSIONS]})
]
Cells = Annotated[
    list[float] | list[list[float]],
    PlainValidator(checks.cells),
    WithJsonSchema({"type": "array", "items": {"anyOf": [{"type": "number"}, {"type": "array"}]}}),
]
Held = Annotated[
    bool | float | list[int | str],
    PlainValidator(checks.held_back),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "boolean"},
                {"type": "number", "minimum": 0, "maximum": 1},
                {"type": "array", "items": {"anyOf": [{"type": "integer"}, {"type": "string"}]}},
            ]
        }
    ),
]
Noise = Annotated[
    list[float],
    PlainValidator(checks.positive_numbers),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "exclusiveMinimum": 0},
                {"type": "array", "items": {"type": "number", "exclusiveMinimum": 0}, "minItems": 1},
            ]
        }
    ),
]


class ColumnsTable(SchemaTable):
    """The columns of a quantity, and their units."""

    columns: Texts = Field(description="names of columns, or one array (n, components) of an NPZ file")
    unit: Unit | None = Field(default=None, description="unit of the columns; default: SI and rad")
    factor: Finite = Field(default=1.0, description="instead of unit: 0.001 for millimetres")
    offset: Finite = Field(default=0.0, description="added after conversion, in SI units")
    quaternion: Literal["wxyz", "xyzw"] = Field(
        default="wxyz", description="order of an orientation's columns; scipy and ROS use xyzw"
    )


class MeasuredTable(ColumnsTable):
    """A measured quantity; NaN or an empty cell is a missing sample."""

    value: str = Field(description='formula: "cube.position", "hinge.angle", "foot.contact_force[2]"')
    name: Label | None = Field(default=None, description="its name in reports; default: the formula")
    noise: Noise | None = Field(
        default=None,
        description="standard deviation in SI units (orientations: rad), or one for each component; default: estimated",
    )


class InputTable(ColumnsTable):
    """A recorded input: the command of a motor, a force or a torque on a body."""

    interpolation: Interpolation = Field(
        default="constant",
        description='"constant" holds each sample until the next one, as motor drives do',
    )
    delay: Finite = Field(
        default=0.0,
        description="the input acts this much later [s]; variables set knee.command.delay",
    )


def leaves(tables: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Quantities and what they are set from, as TOML may nest them: { cube = { position = "x" } } is cube.position."""
    for key, value in tables.items():
        if isinstance(value, Mapping) and value and not value.keys() & InputTable.model_fields.keys():
            yield from leaves(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value


Inputs = Annotated[
    dict[
        str,
        Annotated[
            Annotated[Texts, Tag("<columns>")] | Annotated[InputTable, Tag("<table>")],
            Discriminator(lambda value: "<table>" if isinstance(value, dict | InputTable) else "<columns>"),
        ],
    ],
    BeforeValidator(lambda value: dict(leaves(value)) if isinstance(value, dict) else value),
]
"""By the name of an input its columns, or a table of these."""


class FrameTable(SchemaTable):
    """Pose of the measurement system in the world; for positions, orientations, velocities and forces."""

    position: Vector = Field(default=[0.0, 0.0, 0.0], description="position of its origin [m]")
    orientation: Orientation = Field(
        default=[1.0, 0.0, 0.0, 0.0], description="quaternion [w, x, y, z], or { roll_deg, pitch_deg, yaw_deg }"
    )


class RecordingTable(SchemaTable):
    """Measured motions, from files or from a table."""

    name: Identifier = Field(
        description="recordings are named toss/0017; variables may set toss.offset (seconds added to times) and "
        "toss.scale (factor of lengths)"
    )
    files: Texts | None = Field(
        default=None,
        description='CSV files with a header, or NPZ files, in this folder: "tosses/*.csv"',
    )
    table: dict[str, Cells] | None = Field(
        default=None, description="columns, instead of files: { time = [0, 0.1], z = [1.0, nan] }"
    )
    measured: list[MeasuredTable] = Field(min_length=1, description="the measured quantities and their columns")
    rows: Label | None = Field(
        default=None,
        description="array of an NPZ file with several recordings: their first rows, then the number of rows",
    )
    split: Label | None = Field(default=None, description="a column; a new recording begins where its value changes")
    time: Label | None = Field(default=None, description="column of times; default: time, without rate")
    time_factor: Positive = Field(default=1.0, description="factor of the times: 0.001 for milliseconds")
    rate: Positive | None = Field(default=None, description="sampling rate [Hz], if no column has times")
    clock: Literal["file", "first row"] | None = Field(
        default=None,
        description='"first row": times begin at 0 in each recording; default: "first row" with start, rows or split, '
        'else "file"',
    )
    offset: Finite = Field(default=0.0, description="added to the times [s], after time_factor and clock")
    until: Positive | None = Field(default=None, description="later samples are ignored [s]")
    frame: FrameTable | None = Field(
        default=None,
        description="frame of the measurement system; default: world",
    )
    start: dict[str, Any] = Field(
        default={},
        description='initial state from the first row, in the units of measured: { "cube.position" = ["x", "y", "z"], '
        '"hinge.angle" = { columns = "q", unit = "deg" } }',
    )
    inputs: Inputs = Field(
        default={},
        description='recorded commands, forces and torques: { "knee.command" = "u" } or { "knee.command" = { columns '
        '= "u", unit = "deg" } }; the end values extend',
    )
    held_back: Held = Field(
        default=False,
        description="for validation only: true, a share (evenly spread), or a list of indices or file names",
    )
    weight: Positive = Field(default=1.0, description="factor of the squared residuals")

    @property
    def input_tables(self) -> dict[str, InputTable]:
        """``inputs``, with a table for each."""
        found = self.inputs.items()
        return {name: each if isinstance(each, InputTable) else InputTable(columns=each) for name, each in found}


class RecordedFileTable(SchemaTable):
    """A file of a [[recording]], in run folders."""

    file: str = Field(description="its name beside the problem file")
    path: str = Field(default="", description="its original path")
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="SHA-256 of its unchanged content")
    text: str | None = Field(default=None, description="its content, if small")


class IdentifyTable(SchemaTable):
    """Settings of parameter identification."""

    loss: Literal["squares", "huber"] = Field(
        default="squares", description='loss of normalised residuals; "huber" grows linearly beyond threshold'
    )
    threshold: Positive = Field(default=3.0, description="threshold of the Huber loss, in standard deviations")
    iterations: Annotated[int, Field(ge=0, le=10_000)] = Field(
        default=100, description="iterations of Levenberg-Marquardt"
    )
    tolerance: Positive = Field(default=1e-4, description="converged where a step is smaller, in standard errors")
    bootstrap: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="number of bootstrap fits for a second interval; 0: none"
    )
    horizons: Annotated[
        list[float],
        PlainValidator(checks.rising_to_one),
        WithJsonSchema(
            {"type": "array", "items": {"type": "number", "exclusiveMinimum": 0, "maximum": 1}, "minItems": 1}
        ),
    ] = Field(
        default=[1.0],
        description="increasing shares of the recorded time; [0.3, 0.5, 0.7, 0.85, 1] suits many impacts",
    )
    held_back_starts: Literal["guess", "before impact", "whole"] = Field(
        default="whole",
        description="how starts of held-back recordings are found: from the guess, or fitted up to the first impact "
        "or to the whole",
    )
    check: Literal["none", "cma"] = Field(
        default="none", description='"cma": search for other minima by CMA-ES within the bounds'
    )
    check_evaluations: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=1000, description="evaluations by CMA-ES"
    )
    seed: Annotated[int, Field(ge=0)] = Field(default=0, description="seed of bootstrap and CMA-ES")
