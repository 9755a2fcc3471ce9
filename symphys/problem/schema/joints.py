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

    name: Identifier = Field(description="its name in formulas, variables and settings")
    between: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description='two bodies, or "world" and a body; coordinates are relative to the first'
    )


class MotorTable(kinds_of_motors()):  # type: ignore[misc]
    """One kind of motor."""


class SpringTable(table_of("SpringNumbersTable", fields(Spring))):  # type: ignore[misc]
    """A spring along every coordinate: torque = -stiffness (angle - rest) - damping rate."""


class CouplingTable(SchemaTable):
    """A joint coordinate that follows another one: a gear, a gripper, a mimic joint."""

    name: Identifier = Field(description="its name in states")
    joints: Annotated[list[str], Field(min_length=1, max_length=2)] = Field(
        description="[follower, leader], in one tree, with one coordinate each; a single joint is held at c0"
    )
    polynomial: Annotated[list[Finite], Field(min_length=1, max_length=5)] = Field(
        default=[0.0, 1.0],
        description="[c0, ..., c4]: follower = c0 + c1 q + c2 q^2 + ..., with the leader's coordinate q",
    )


class SiteMotorTable(table_of("SiteMotorNumbersTable", fields(SiteMotor))):  # type: ignore[misc]
    """A force and a torque at the site, proportional to a command: a rotor, a thruster."""


class SiteTable(SchemaTable):
    """A named frame on a body, for formulas and thrusters."""

    name: Identifier = Field(description="its name in formulas: name.position, name.orientation, name.velocity")
    body: str = Field(description='the body that carries it, or "world"')
    position: Vector = Field(default=[0.0, 0.0, 0.0], description="in the body's frame, from its centre of mass [m]")
    orientation: Orientation = Field(default=[1.0, 0.0, 0.0, 0.0], description=UPRIGHT)
    motor: SiteMotorTable | None = Field(default=None, description=f"driven by name.command: {SiteMotor.example}")


class JointTable(kinds_of_joints()):  # type: ignore[misc]
    """A joint between two bodies, or a body and the world.

    Give one kind: ball, hinge, slider, helical, universal or fixed. Coordinates are 0 in the pose of the file. Angles
    count whole turns.
    """

    point: Vector | None = Field(
        default=None, description="position of the joint in the file's pose, world coordinates [m]"
    )
    anchors: Annotated[list[Vector], Field(min_length=2, max_length=2)] | None = Field(
        default=None,
        description="instead of point: its position in the frames of both bodies [m], which must coincide",
    )
    motor: MotorTable | None = Field(
        default=None, description="drives every coordinate: { servo = { gain = 20, torque = 30, velocity = 8 } }"
    )
    limits: Ends | None = Field(
        default=None,
        description="[lower, upper] of every coordinate [rad] or [m]; -inf and inf mean none",
    )
    limits_deg: Ends | None = Field(default=None, description="limits in degrees, for joints that turn")
    start: Coordinates | None = Field(
        default=None,
        description="initial coordinate [rad] or [m], or a list; moves the second body and its descendants; default 0",
    )
    start_deg: Coordinates | None = Field(default=None, description="start in degrees, for joints that turn")
    spring: SpringTable | None = Field(default=None, description="{ stiffness = 5, damping = 0.1, rest = 0 }")
    armature: NonNegative = OWN["armature"]
    friction: NonNegative = OWN["friction"]
    frequency: NonNegative = Field(default=0.0, description="natural frequency of a compliant joint [Hz]; 0: rigid")
    damping: NonNegative | None = Field(default=None, description="damping ratio of a compliant joint; default 1")
    collide: bool = Field(default=False, description="whether the two bodies may touch each other")
