"""Tables of the files that a problem includes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PlainValidator, WithJsonSchema

from symphys.problem.schema import checks
from symphys.problem.schema.types import Finite, SchemaTable, Vector

MAX_INCLUDES = 100
Prefix = Annotated[
    str,
    PlainValidator(checks.prefix),
    WithJsonSchema({"type": "string", "pattern": f"^({checks.IDENTIFIER})?$", "maxLength": checks.MAX_IDENTIFIER}),
]


class IncludeTable(SchemaTable):
    """A file whose tables are put before those of this one: a robot, a course.

    It holds what a problem file may, but for [simulation], [objective], [solver] and further includes.
    """

    file: str = Field(
        min_length=1,
        description='"robots/table_robot.toml": relative to the folder of this file, else a shipped robot of that path;'
        " a model of MuJoCo (.xml) or a URDF (.urdf) becomes tables, see the page Robots of the documentation",
    )
    position: Vector = Field(
        default=[0.0, 0.0, 0.0],
        description="shifts its bodies, joints, planes and blocks [m], after the turn; its ground, variables and "
        "formulas stay as they are",
    )
    yaw_deg: Finite = Field(default=0.0, description="turns them about the z axis of the world, with their velocities")
    prefix: Prefix = Field(
        default="", description='put before all names of that file, where they are used too: "left_" makes left_torso'
    )
    keyframe: str | None = Field(
        default=None, description="of an .xml: its keyframe at which the robot begins; otherwise at its reference pose"
    )
    self_collision: bool = Field(
        default=True, description="of an .xml or .urdf: whether bodies of the robot may touch each other"
    )
    base: Literal["auto", "free", "fixed"] = Field(
        default="auto",
        description='of a .urdf: whether its root link floats; "auto": see the page Robots of the documentation',
    )


class IncludedTable(SchemaTable):
    """The text of an included file, as run folders keep it."""

    file: str = Field(description="as [[include]] names it")
    text: str = Field(description="what is in it; it goes before the file itself")
