"""The table of a sweep: keys of the file that take several values, each a problem of its own."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from symphys.problem.schema.types import Finite, SchemaTable

MAX_SAMPLES = 1_000_000
MAX_VALUES = 10_000
Samples = Literal["grid", "latin hypercube", "sobol"]


class RangeTable(SchemaTable):
    """Numbers from one end to the other."""

    start: Finite = Field(alias="from", description="the first value")
    to: Finite = Field(description="the last value, included")
    count: Annotated[int, Field(ge=2, le=MAX_VALUES)] | None = Field(
        default=None, description="number of values; without it, samples take any number in the range"
    )
    spacing: Literal["linear", "log"] = Field(default="linear", description='"log": by equal factors')


AXIS: dict[str, Any] = {
    "anyOf": [
        {"type": "array", "minItems": 1},
        {
            "type": "object",
            "properties": {
                "from": {"type": "number"},
                "to": {"type": "number"},
                "count": {"type": "integer", "minimum": 2, "maximum": MAX_VALUES},
                "spacing": {"enum": ["linear", "log"]},
            },
        },
    ]
}
"""The JSON Schema of an axis; a table without ``from`` holds further keys, as TOML reads ``ball.mass = [1, 2]``."""


class SweepTable(SchemaTable):
    """Keys that take several values; `symphys solve` solves every combination, or samples of them.

    Further keys are those of `--set`, such as `"ball.mass"`, each with a list of values or a table
    { from = 0.2, to = 2, count = 10, spacing = "log" }. [Sweeps](command_line.md#sweeps) has examples.
    """

    model_config = ConfigDict(extra="allow", json_schema_extra={"additionalProperties": AXIS})

    samples: Samples = Field(default="grid", description="all combinations, or space-filling samples")
    count: Annotated[int, Field(ge=1, le=MAX_SAMPLES)] | None = Field(
        default=None, description="number of samples, for Sobol a power of two; not for a grid"
    )
    seed: Annotated[int, Field(ge=0)] = Field(default=0, description="seed of the samples")
