"""A ball joint: two points stay together; every rotation is free, and none of them has a coordinate."""

from __future__ import annotations

from typing import ClassVar

from symphys.model.joints.kind import Kind
from symphys.model.joints.specs import JointSpec
from symphys.records import dataclass

BALL = Kind("ball")


@dataclass(frozen=True)
class BallJoint(JointSpec):
    """Two points stay together; all turns are free."""

    summary: ClassVar[str] = "all rotations about a point"

    @property
    def kind(self) -> Kind:
        """Return the kind of joint."""
        return BALL
