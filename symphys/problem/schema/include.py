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
    """A file whose tables come before those of this file: a robot, a course.

    It may hold any table but [simulation], [objective], [solver] and [[include]].
    """

    file: str = Field(
        min_length=1,
        description='a path relative to this file, or a shipped robot: "robots/table_robot.toml"; MuJoCo (.xml) and '
        "URDF (.urdf) models are converted, see the page Robots",
    )
    position: Vector = Field(
        default=[0.0, 0.0, 0.0],
        description="shift of its bodies, joints, planes and blocks [m], after the rotation",
    )
    yaw_deg: Finite = Field(default=0.0, description="rotation about the world's z axis, velocities included")
    prefix: Prefix = Field(default="", description='put before all its names: "left_" makes left_torso')
    keyframe: str | None = Field(default=None, description="initial keyframe of an .xml; default: the reference pose")
    self_collision: bool = Field(
        default=True, description="whether the bodies of an .xml or .urdf may touch each other"
    )
    base: Literal["auto", "free", "fixed"] = Field(
        default="auto",
        description="whether the root link of a .urdf floats",
    )


class IncludedTable(SchemaTable):
    """The text of an included file, in run folders."""

    file: str = Field(description="as [[include]] names it")
    text: str = Field(description="its content")
