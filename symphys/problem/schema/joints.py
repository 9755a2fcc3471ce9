"""Tables of joints: what they hold together, what they leave free, and what acts along that."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, create_model

from symphys.model.joints import JOINTS
from symphys.problem.schema.shapes import UPRIGHT
from symphys.problem.schema.types import (
    Coordinates,
    Ends,
    Finite,
    Identifier,
    NonNegative,
    NonZero,
    Orientation,
    Positive,
    SchemaTable,
    Vector,
)

VALUES: dict[str, Any] = {
    "direction": Vector,
    "directions": Annotated[list[Vector], Field(min_length=2, max_length=2)],
    "nonzero": NonZero,
}
"""Types of the keys of kinds of joints, by the metadata of ``JointSpec``."""


def kinds_of_joints() -> type[SchemaTable]:
    """Make a table with an optional table for each kind of joint, after the keys of ``HeldTable``."""
    found: dict[str, Any] = {}
    for word, spec in JOINTS.items():
        keys: dict[str, Any] = {
            each.name: (VALUES[each.metadata["value"]], Field(description=each.metadata["about"]))
            for each in spec.own_fields()
        }
        name = f"{word.capitalize()}JointTable"
        about = f"{spec.summary[:1].upper()}{spec.summary[1:]}."
        table = create_model(name, __base__=SchemaTable, __doc__=about, __module__=__name__, **keys)
        found[word] = (table | None, Field(default=None, description=f"{spec.example}: {spec.summary}"))
    return create_model("KindsOfJointsTable", __base__=HeldTable, __module__=__name__, **found)


class HeldTable(SchemaTable):
    """The name of a joint and the bodies that it connects."""

    name: Identifier = Field(description="how formulas, variables and settings refer to it")
    between: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description='two bodies, or "world" and a body; coordinates are those of the second against the first'
    )


class ServoTable(SchemaTable):
    """A motor whose command is an angle, or a position: the target velocity is gain (command - angle).

    Angles count whole turns: a command of 18.85 rad is three turns.
    """

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


class AffineTable(SchemaTable):
    """A motor whose torque is affine in its command and in the joint's coordinate and rate.

    It is gear clip(gain clip(command, command_range) + offset - kp gear q - kv gear v, force_range); q and v are the
    joint's coordinate and its rate. MuJoCo's motor, position, velocity and general actuators are such.
    """

    gain: Finite = Field(default=1.0, description="force by command, before the gear")
    offset: Finite = Field(default=0.0, description="force at command 0, before the gear [N m], or [N]")
    kp: Finite = Field(default=0.0, description="by the position behind the gear [N m/rad], or [N/m]")
    kv: Finite = Field(default=0.0, description="by the velocity behind the gear [N m s/rad], or [N s/m]")
    gear: Finite = Field(default=1.0, description="ratio of the gear; a negative one turns the direction around")
    command_range: Ends | None = Field(default=None, description="least and largest command; default: any")
    force_range: Ends | None = Field(
        default=None, description="least and largest force before the gear [N m], or [N]; default: any"
    )


class MotorTable(SchemaTable):
    """One of four kinds of motors."""

    servo: ServoTable | None = Field(default=None, description="{ gain = 20, torque = 30, velocity = 8 }")
    velocity: VelocityTable | None = Field(default=None, description="{ torque = 30, velocity = 8 }")
    torque: TorqueTable | None = Field(default=None, description="{ torque = 30 }")
    affine: AffineTable | None = Field(default=None, description="{ gear = 150, command_range = [-1, 1] }")


class SpringTable(SchemaTable):
    """Along every coordinate: torque = -stiffness (angle - rest) - damping rate."""

    stiffness: NonNegative = Field(default=0.0, description="torque per angle [N m/rad], or force per length [N/m]")
    damping: NonNegative = Field(default=0.0, description="torque per rate [N m s/rad], or force per velocity [N s/m]")
    rest: Finite = Field(default=0.0, description="where it gives nothing [rad], through any number of turns, or [m]")


class CouplingTable(SchemaTable):
    """A coordinate that follows another: a gear, a parallel gripper, a joint that mimics another."""

    name: Identifier = Field(description="how states refer to it")
    joints: Annotated[list[str], Field(min_length=1, max_length=2)] = Field(
        description="the joint that follows and the one that it follows, each with one coordinate and in one tree; one "
        "alone is held where the polynomial says"
    )
    polynomial: Annotated[list[Finite], Field(min_length=1, max_length=5)] = Field(
        default=[0.0, 1.0],
        description="[c0, c1, c2, c3, c4]: the first coordinate is c0 + c1 q + c2 q^2 + ... of the second's q, an "
        "angle that counts whole turns: a screw of lead h has [0, h / 6.2832]",
    )


class SiteTable(SchemaTable):
    """A named point with axes on a body: formulas name its position, orientation and velocity."""

    name: Identifier = Field(description="how formulas refer to it: name.position, name.orientation, name.velocity")
    body: str = Field(description='the body that carries it, or "world"')
    position: Vector = Field(
        default=[0.0, 0.0, 0.0], description="from the centre of mass, in the body's frame [m]; world coordinates there"
    )
    orientation: Orientation = Field(default=[1.0, 0.0, 0.0, 0.0], description=UPRIGHT)


class JointTable(kinds_of_joints()):  # type: ignore[misc]
    """What holds two bodies together, or a body to the world; coordinates are 0 as the bodies lie in the file.

    With ``start`` they begin elsewhere. Angles count whole turns: a hinge that has gone round twice is at 12.57 rad.
    The table of one kind says how.
    """

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
        default=None,
        description="[lower, upper] of every coordinate [rad], through any number of turns, or [m]; -inf and inf are "
        "none",
    )
    limits_deg: Ends | None = Field(default=None, description="the same in degrees, where the joint turns")
    start: Coordinates | None = Field(
        default=None,
        description="the coordinate at the start [rad], or [m], or a list of all; default 0. The second body, and all "
        "that hangs on it, is carried there from where it lies in the file",
    )
    start_deg: Coordinates | None = Field(default=None, description="the same in degrees, where the joint turns")
    spring: SpringTable | None = Field(default=None, description="{ stiffness = 5, damping = 0.1, rest = 0 }")
    armature: NonNegative = Field(
        default=0.0,
        description="inertia that turns with each coordinate, as a rotor does, seen through its gear [kg m^2], or [kg]",
    )
    friction: NonNegative = Field(default=0.0, description="dry friction along every coordinate [N m], or [N]")
    frequency: NonNegative = Field(default=0.0, description="natural frequency of a compliant joint [Hz]; 0: rigid")
    damping: NonNegative | None = Field(default=None, description="damping ratio of a compliant joint; default 1")
    collide: bool = Field(default=False, description="whether the two bodies may touch each other")
