"""Tables of joints: what they hold together, what they leave free, and what acts along that."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from symphys.problem.schema.types import (
    Coordinates,
    Ends,
    Finite,
    Identifier,
    NonNegative,
    Positive,
    SchemaTable,
    Vector,
)

AXIS = "[x, y, z], world coordinates at the start, any length but 0"


class BareTable(SchemaTable):
    """A kind without keys: { }."""


class AxisTable(SchemaTable):
    """A hinge or a slider."""

    axis: Vector = Field(description=f"about or along which the second body moves: {AXIS}")


class UniversalTable(SchemaTable):
    """A universal joint."""

    axes: Annotated[list[Vector], Field(min_length=2, max_length=2)] = Field(
        description="two, perpendicular to each other: the first stays with the first body, the second with the "
        f"second; each {AXIS}"
    )


class ServoTable(SchemaTable):
    """A motor whose command is an angle, or a position: the target velocity is gain (command - angle)."""

    gain: Positive = Field(description="target velocity per difference of angle or position [1/s]")
    torque: Positive = Field(description="the most that it gives [N m], or [N] where the joint slides")
    velocity: Positive = Field(description="the fastest that it aims at [rad/s], or [m/s]")
    range: Positive | None = Field(
        default=None, description="commands are held within so much either way [rad], or [m]; default: any"
    )


class VelocityTable(SchemaTable):
    """A motor whose command is a velocity."""

    torque: Positive = Field(description="the most that it gives [N m], or [N] where the joint slides")
    velocity: Positive = Field(description="the fastest that it aims at [rad/s], or [m/s]")


class TorqueTable(SchemaTable):
    """A motor whose command is a torque [N m], or a force [N] where the joint slides."""

    torque: Positive = Field(description="the most that it gives [N m], or [N] where the joint slides")


class MotorTable(SchemaTable):
    """One of three kinds of motors."""

    servo: ServoTable | None = Field(default=None, description="{ gain = 20, torque = 30, velocity = 8 }")
    velocity: VelocityTable | None = Field(default=None, description="{ torque = 30, velocity = 8 }")
    torque: TorqueTable | None = Field(default=None, description="{ torque = 30 }")


class SpringTable(SchemaTable):
    """Along every coordinate: torque = -stiffness (angle - rest) - damping rate."""

    stiffness: NonNegative = Field(default=0.0, description="torque per angle [N m/rad], or force per length [N/m]")
    damping: NonNegative = Field(default=0.0, description="torque per rate [N m s/rad], or force per velocity [N s/m]")
    rest: Finite = Field(default=0.0, description="where it gives nothing [rad], or [m]")


class JointTable(SchemaTable):
    """What holds two bodies together, or a body to the world; coordinates are 0 as the bodies lie in the file.

    With ``start`` they begin elsewhere. One of ball, hinge, slider, universal and fixed says how.
    """

    name: Identifier = Field(description="how formulas, variables and settings refer to it")
    between: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description='two bodies, or "world" and a body; coordinates are those of the second against the first'
    )
    ball: BareTable | None = Field(default=None, description="{ }: two points stay together, all turns are free")
    hinge: AxisTable | None = Field(default=None, description="{ axis = [0, 1, 0] }: turns about an axis")
    slider: AxisTable | None = Field(default=None, description="{ axis = [1, 0, 0] }: moves along an axis")
    universal: UniversalTable | None = Field(
        default=None, description="{ axes = [[0, 1, 0], [1, 0, 0]] }: turns about two axes"
    )
    fixed: BareTable | None = Field(default=None, description="{ }: nothing is left free")
    point: Vector | None = Field(default=None, description="where the joint is at the start, world coordinates [m]")
    anchors: Annotated[list[Vector], Field(min_length=2, max_length=2)] | None = Field(
        default=None,
        description="instead of point: the joint's place on the first and on the second, each in its body's frame [m] "
        "(that of the world in world coordinates); at the start the two must meet",
    )
    motor: MotorTable | None = Field(
        default=None, description="drives every coordinate: { servo = { gain = 20, torque = 30, velocity = 8 } }"
    )
    limits: Ends | None = Field(
        default=None, description="[lower, upper] of every coordinate [rad], or [m]; -inf and inf are none"
    )
    limits_deg: Ends | None = Field(default=None, description="the same in degrees, where the joint turns")
    start: Coordinates | None = Field(
        default=None,
        description="the coordinate at the start [rad], or [m], or a list of all; default 0. The second body, and all "
        "that hangs on it, is carried there from where it lies in the file",
    )
    start_deg: Coordinates | None = Field(default=None, description="the same in degrees, where the joint turns")
    spring: SpringTable | None = Field(default=None, description="{ stiffness = 5, damping = 0.1, rest = 0 }")
    frequency: NonNegative = Field(default=0.0, description="of a joint that gives way [Hz]; 0: rigid")
    damping: NonNegative | None = Field(default=None, description="damping ratio of a joint that gives way; default 1")
    collide: bool = Field(default=False, description="whether the two bodies may touch each other")
