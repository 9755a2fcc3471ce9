"""A fixed joint: both frames stay together, point and axes."""

from __future__ import annotations

from typing import ClassVar

from symphys.model.joints.kind import Kind
from symphys.model.joints.specs import JointSpec
from symphys.records import dataclass

FIXED = Kind("fixed", turns=((0, 1), (1, 2), (2, 0)))


@dataclass(frozen=True)
class FixedJoint(JointSpec):
    """A joint without degrees of freedom."""

    summary: ClassVar[str] = "no degrees of freedom"
    anywhere: ClassVar[bool] = True

    @property
    def kind(self) -> Kind:
        """Return the kind of joint."""
        return FIXED
