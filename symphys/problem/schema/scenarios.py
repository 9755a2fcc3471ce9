"""Tables of domain randomization: what no solver chooses, and for which a solution must work all the same."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from symphys.problem.schema.types import Coordinates, Identifier, Label, NonNegative, Positive, SchemaTable, Texts

Below = Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)]


class DiscretisationTable(SchemaTable):
    """Another way to compute the same motion; what is left out is that of [simulation]."""

    dt: Positive | None = Field(default=None, description="time step [s]")
    sweeps: Annotated[int, Field(ge=1, le=10_000)] | None = Field(default=None, description="of the contact solver")


class ScenarioTable(SchemaTable):
    """Something that differs from sample to sample: numbers, the pose of a robot, or the time step."""

    name: Identifier = Field(description="for messages and reports")
    sets: Texts | None = Field(
        default=None, description='numbers, as variables name them: "ground.friction", "torso.mass", "torso.force"'
    )
    factor: Below | None = Field(
        default=None, description="0.3: times a number drawn evenly from 0.7 to 1.3, each its own"
    )
    shift: Coordinates | None = Field(
        default=None, description="plus a number drawn evenly from -shift to shift; one number, or one a component"
    )
    alike: bool = Field(default=False, description="one random number for all, instead of one for each")
    lasts: Positive | None = Field(
        default=None, description="a force, torque or command acts so long [s], from an instant that is random, too"
    )
    robot: Label | None = Field(default=None, description="a body: the pose of all that joints hold together with it")
    tilt: NonNegative = Field(default=0.0, description="of a robot: turned about each axis by at most so much [rad]")
    tilt_deg: NonNegative = Field(default=0.0, description="the same in degrees")
    joints: NonNegative = Field(default=0.0, description="of a robot: each rigid hinge turned by at most so much [rad]")
    joints_deg: NonNegative = Field(default=0.0, description="the same in degrees")
    velocity: NonNegative = Field(
        default=0.0, description="of a robot: its bodies move alike, at most so fast along each axis [m/s]"
    )
    simulation: DiscretisationTable | None = Field(
        default=None, description="{ dt = 0.005 }: some samples are computed with another time step, or more sweeps"
    )
