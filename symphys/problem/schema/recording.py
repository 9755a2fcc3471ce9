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

    columns: Texts = Field(description='names of columns, or one array (n, components) of an NPZ file: "orientation"')
    unit: Unit | None = Field(default=None, description="of the columns; default: that of the engine, SI and rad")
    factor: Finite = Field(default=1.0, description="of the numbers, instead of unit: 0.001 for millimetres")
    offset: Finite = Field(default=0.0, description="added after that, in the unit of the engine")
    quaternion: Literal["wxyz", "xyzw"] = Field(
        default="wxyz", description="the order of the columns of an orientation; scipy and ROS have xyzw"
    )


class MeasuredTable(ColumnsTable):
    """A quantity that was measured. NaN or an empty cell is a missing sample."""

    value: str = Field(
        description='formula of what the columns are: "cube.position", "cube.orientation", "hinge.angle", '
        '"ball.position[2]", "foot.contact_force[2]"'
    )
    name: Label | None = Field(default=None, description="how reports refer to it; default: the formula")
    noise: Noise | None = Field(
        default=None,
        description="standard deviation, or one for each component, in the unit of the engine; of an orientation in "
        "rad; default: estimated",
    )


class InputTable(ColumnsTable):
    """An input that was recorded: the command of a motor, a force or a torque on a body."""

    interpolation: Interpolation = Field(
        default="constant",
        description='between samples: "constant", held until the next one, as drives hold their commands, or "linear"',
    )
    delay: Finite = Field(
        default=0.0,
        description="it acts so much later than recorded [s]; a variable may set knee.command.delay, for all tables",
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
    """Origin and axes of the measurement system in the world."""

    position: Vector = Field(default=[0.0, 0.0, 0.0], description="of its origin [m]")
    orientation: Orientation = Field(
        default=[1.0, 0.0, 0.0, 0.0], description="of its axes: (w, x, y, z), or { roll_deg, pitch_deg, yaw_deg }"
    )


class RecordingTable(SchemaTable):
    """Measured motions: from files, or from a table of numbers in this file."""

    name: Identifier = Field(
        description="of the recordings: toss/0017. Variables may set toss.offset, what is added to its times in "
        "seconds, and toss.scale, a factor of its lengths"
    )
    files: Texts | None = Field(
        default=None,
        description='CSV files with a header, or NPZ files, beside this file: "tosses/*.csv", or a list; a pattern '
        "stays in the folder of this file",
    )
    table: dict[str, Cells] | None = Field(
        default=None, description="columns, instead of files: { time = [0, 0.1], z = [1.0, nan] }"
    )
    measured: list[MeasuredTable] = Field(min_length=1, description="which columns are which quantities")
    rows: Label | None = Field(
        default=None,
        description="of an NPZ file with one recording after the other: the array of their first rows, and at its end "
        "the number of all rows",
    )
    split: Label | None = Field(
        default=None, description="a column of numbers; where its value changes, the next recording begins"
    )
    time: Label | None = Field(default=None, description="the column of times; default: time, without rate")
    time_factor: Positive = Field(default=1.0, description="of the times: 0.001 for milliseconds")
    rate: Positive | None = Field(default=None, description="samples in a second [Hz], where no column has the time")
    clock: Literal["file", "first row"] | None = Field(
        default=None,
        description="whether times are those of the file, or begin with 0 at the first row of each recording; "
        'default: "first row" with start, rows or split, otherwise "file"',
    )
    offset: Finite = Field(default=0.0, description="added to the times [s], after time_factor and clock")
    until: Positive | None = Field(default=None, description="later samples are left out [s]")
    frame: FrameTable | None = Field(
        default=None,
        description="of the measurement system, for positions, orientations, velocities and forces; default: that of "
        "the world",
    )
    start: dict[str, Any] = Field(
        default={},
        description='what the first row sets at the start of the motion: { "cube.position" = ["x", "y", "z"] }, with '
        'the units of the same columns in measured, or { "cube.velocity" = { columns = "v", unit = "mm/s" } }. Joints '
        "too: hinge.angle, hinge.rate",
    )
    inputs: Inputs = Field(
        default={},
        description='what drove the motion, recorded beside it: { "knee.command" = "u" }, or { "knee.command" = { '
        'columns = "u", unit = "deg", interpolation = "linear" } }; also forces and torques on bodies. Before the '
        "first and after the last sample values stay, and rows without a number are left out",
    )
    held_back: Held = Field(
        default=False,
        description="recordings that are predicted only, not fitted to: true, a share such as 0.3 (evenly spread), or "
        "a list of numbers from 0 or of names of files",
    )
    weight: Positive = Field(default=1.0, description="factor of the squared residuals")

    @property
    def input_tables(self) -> dict[str, InputTable]:
        """``inputs``, with a table for each."""
        found = self.inputs.items()
        return {name: each if isinstance(each, InputTable) else InputTable(columns=each) for name, each in found}


class RecordedFileTable(SchemaTable):
    """A file of a [[recording]], as run folders keep it."""

    file: str = Field(description="as found beside the problem file")
    path: str = Field(default="", description="where it was")
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of its content, which must not have changed")
    text: str | None = Field(default=None, description="what is in it, where it is small")


class IdentifyTable(SchemaTable):
    """Settings of the identification of parameters from recordings."""

    loss: Literal["squares", "huber"] = Field(
        default="squares", description='of residuals over their noise; "huber" grows linearly beyond threshold'
    )
    threshold: Positive = Field(default=3.0, description="of the Huber loss, in standard deviations")
    iterations: Annotated[int, Field(ge=0, le=10_000)] = Field(default=100, description="of Levenberg-Marquardt")
    tolerance: Positive = Field(
        default=1e-4, description="converged where a step is below this share of the standard errors"
    )
    bootstrap: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="fits to recordings drawn anew, whose spread gives a second interval; 0: none"
    )
    horizons: Annotated[
        list[float],
        PlainValidator(checks.rising_to_one),
        WithJsonSchema(
            {"type": "array", "items": {"type": "number", "exclusiveMinimum": 0, "maximum": 1}, "minItems": 1}
        ),
    ] = Field(
        default=[1.0],
        description="shares of the recordings' time that are fitted one after the other, rising to 1: "
        "[0.3, 0.5, 0.7, 0.85, 1] follows motions with many impacts",
    )
    held_back_starts: Literal["guess", "before impact", "whole"] = Field(
        default="whole",
        description="where own numbers of recordings that are held back come from, such as their starts: the guess, a "
        "fit to what was measured before the first impact, or to the whole; shared numbers stay",
    )
    check: Literal["none", "cma"] = Field(
        default="none", description='"cma": CMA-ES looks for other minima, from the same bounds'
    )
    check_evaluations: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=1000, description="of the whole residuals by CMA-ES"
    )
    seed: Annotated[int, Field(ge=0)] = Field(default=0, description="of the random numbers of both")
