"""Tables of joints: what they hold together, what they leave free, and what acts along that."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any

from pydantic import Field, create_model

from symphys.model.body import SiteMotor
from symphys.model.joints import JOINTS, Joint, Spring
from symphys.model.joints.motor import MOTORS
from symphys.problem.schema.declared import keys_of, table_of
from symphys.problem.schema.shapes import UPRIGHT
from symphys.problem.schema.types import (
    Coordinates,
    Ends,
    Finite,
    Identifier,
    NonNegative,
    Orientation,
    SchemaTable,
    Vector,
)


def kinds_of_joints() -> type[SchemaTable]:
    """Make a table with an optional table for each kind of joint, after the keys of ``HeldTable``."""
    found: dict[str, Any] = {}
    for word, spec in JOINTS.items():
        about = f"{spec.summary[:1].upper()}{spec.summary[1:]}."
        table = table_of(f"{word.capitalize()}JointTable", fields(spec), about)
        found[word] = (table | None, Field(default=None, description=f"{spec.example}: {spec.summary}"))
    return create_model("KindsOfJointsTable", __base__=HeldTable, __module__=__name__, **found)


def kinds_of_motors() -> type[SchemaTable]:
    """Make a table with an optional table for each kind of motor."""
    found: dict[str, Any] = {}
    for word, motor in MOTORS.items():
        table = table_of(f"{word.capitalize()}Table", fields(motor), motor.summary)
        found[word] = (table | None, Field(default=None, description=motor.example))
    return create_model("KindsOfMotorsTable", __base__=SchemaTable, __module__=__name__, **found)


OWN = {name: field for name, (_, field) in keys_of(fields(Joint)).items()}
"""Keys of what every joint has."""


class HeldTable(SchemaTable):
    """The name of a joint and the bodies that it connects."""

    name: Identifier = Field(description="how formulas, variables and settings refer to it")
    between: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description='two bodies, or "world" and a body; coordinates are those of the second against the first'
    )


class MotorTable(kinds_of_motors()):  # type: ignore[misc]
    """One kind of motor."""


class SpringTable(table_of("SpringNumbersTable", fields(Spring))):  # type: ignore[misc]
    """Along every coordinate: torque = -stiffness (angle - rest) - damping rate."""


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


class SiteMotorTable(table_of("SiteMotorNumbersTable", fields(SiteMotor))):  # type: ignore[misc]
    """A force at the site and a torque, along the site's axes, in proportion to a command: a rotor, a thruster."""


class SiteTable(SchemaTable):
    """A named point with axes on a body: formulas name its position, orientation and velocity."""

    name: Identifier = Field(description="how formulas refer to it: name.position, name.orientation, name.velocity")
    body: str = Field(description='the body that carries it, or "world"')
    position: Vector = Field(
        default=[0.0, 0.0, 0.0], description="from the centre of mass, in the body's frame [m]; world coordinates there"
    )
    orientation: Orientation = Field(default=[1.0, 0.0, 0.0, 0.0], description=UPRIGHT)
    motor: SiteMotorTable | None = Field(
        default=None, description=f"acts on the body by the command name.command: {SiteMotor.example}"
    )


class JointTable(kinds_of_joints()):  # type: ignore[misc]
    """A joint between two bodies, or a body and the world; coordinates are 0 as the bodies lie in the file.

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
    armature: NonNegative = OWN["armature"]
    friction: NonNegative = OWN["friction"]
    frequency: NonNegative = Field(default=0.0, description="natural frequency of a compliant joint [Hz]; 0: rigid")
    damping: NonNegative | None = Field(default=None, description="damping ratio of a compliant joint; default 1")
    collide: bool = Field(default=False, description="whether the two bodies may touch each other")
