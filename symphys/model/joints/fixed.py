"""A fixed joint: both frames stay together, point and axes."""

from __future__ import annotations

from symphys.model.joints.kind import Kind

FIXED = Kind("fixed", turns=((0, 1), (1, 2), (2, 0)))
