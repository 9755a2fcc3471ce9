"""Tables of domain randomization: what no solver chooses, and for which a solution must work all the same."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from symphys.problem.schema.types import Coordinates, Identifier, Label, NonNegative, Positive, SchemaTable, Texts

Below = Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)]


class DiscretisationTable(SchemaTable):
    """Other settings of the integrator; the rest is as in [simulation]."""

    dt: Positive | None = Field(default=None, description="time step [s]")
    sweeps: Annotated[int, Field(ge=1, le=10_000)] | None = Field(
        default=None, description="sweeps of the contact solver"
    )


class ScenarioTable(SchemaTable):
    """A random difference between samples: in values, in the pose of a robot, or in the time step."""

    name: Identifier = Field(description="for messages and reports")
    sets: Texts | None = Field(default=None, description="quantities, as in [[variable]]")
    factor: Below | None = Field(default=None, description="0.3: times a uniform random number from 0.7 to 1.3")
    shift: Coordinates | None = Field(
        default=None,
        description="plus a uniform random number from -shift to shift; a number, or one a component",
    )
    alike: bool = Field(default=False, description="use one random number for the whole list")
    lasts: Positive | None = Field(
        default=None, description="a force, torque or command acts for this long [s], from a random instant"
    )
    robot: Label | None = Field(default=None, description="a body; the pose of all bodies jointed to it varies")
    tilt: NonNegative = Field(default=0.0, description="largest rotation of the robot about each axis [rad]")
    tilt_deg: NonNegative = Field(default=0.0, description="tilt in degrees")
    joints: NonNegative = Field(default=0.0, description="largest rotation of each rigid hinge [rad]")
    joints_deg: NonNegative = Field(default=0.0, description="joints in degrees")
    velocity: NonNegative = Field(
        default=0.0, description="largest common velocity of the robot's bodies along each axis [m/s]"
    )
    simulation: DiscretisationTable | None = Field(
        default=None, description="{ dt = 0.005 }: simulate some samples with other settings"
    )
