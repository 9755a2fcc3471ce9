"""Tables of a receding horizon: how a controller plans anew at every tick, and the plant that it is tried on."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from symphys.problem.schema.types import NonNegative, Positive, SchemaTable

Iterations = Annotated[int, Field(ge=1, le=1000)]
Seed = Annotated[int, Field(ge=0)]
Latency = NonNegative | Literal["measured", "cpu"]


class PlantTable(SchemaTable):
    """The plant that `symphys mpc` simulates in place of the real robot."""

    dt: Positive | None = Field(
        default=None,
        description="longest time step [s]; every tick has a whole number of steps. Default: half of [simulation]'s dt",
    )
    masses: Positive = Field(default=1.0, description="factor of all masses and inertias")
    set: dict[str, Any] = Field(
        default={}, description='other values, by the keys of --set: { "ground.friction" = 0.6, "upper.mass" = 1.2 }'
    )
    noise: NonNegative = Field(default=0.0, description="standard deviation of measured positions [m] and angles [rad]")
    rate_noise: NonNegative = Field(default=0.0, description="standard deviation of measured velocities [m/s, rad/s]")
    seed: Seed = Field(default=0, description="seed of the noise")
    delay: NonNegative = Field(default=0.0, description="from a command to its effect [s], in whole steps of the plant")
    latency: Latency = Field(
        default="measured",
        description='from a measurement to its plan [s]: a number, the solver\'s wall time ("measured") or processor '
        'time ("cpu")',
    )


class MpcTable(SchemaTable):
    """Model predictive control, for `symphys mpc` and symphys.Controller."""

    rate: Positive = Field(description="measurements and plans per second [Hz]")
    horizon: Positive | None = Field(
        default=None, description="length of a plan [s], a whole number of dt; default: the whole duration"
    )
    dt: Positive | None = Field(default=None, description="time step of the model [s]; default: that of [simulation]")
    iterations: Iterations = Field(default=1, description="iLQR iterations in each tick")
    first_iterations: Iterations = Field(
        default=50, description="iLQR iterations before the first tick, from the guess"
    )
    damping: Positive = Field(default=1e-4, description="initial and smallest regularisation, in units of scale")
    smoothing: NonNegative | None = Field(
        default=None, description="smoothing of the model's contacts [m/s]; default: the last stage of [simulation]"
    )
    feedback: bool = Field(
        default=False, description="correct commands between ticks by the feedback gains of the plan"
    )
    duration: Positive | None = Field(
        default=None, description="length of a `symphys mpc` run [s]; default: five times [simulation]'s duration"
    )
    plant: PlantTable = PlantTable()
