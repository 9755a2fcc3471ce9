"""A ball joint: two points stay together; every rotation is free, and none of them has a coordinate."""

from __future__ import annotations

from symphys.model.joints.kind import Kind

BALL = Kind("ball")
