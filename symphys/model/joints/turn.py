"""Where the angles of a joint are cut: they are told from half a turn below a centre to half a turn above it."""

from __future__ import annotations

from math import isfinite, pi
from typing import Any

import casadi as ca

Expr = Any
"""casadi SX, MX or DM"""
NEAR = 1.0
"""[rad] Limits that are so near to half a turn are better in the middle of what is told."""
ROOM = 0.5
"""[rad] beyond a limit without a counterpart."""


def natural_centre(lower: float | None, upper: float | None) -> float:
    """The centre of a joint with these limits [rad], so that what passes one of them is not told to be past the other.

    Example:
        >>> natural_centre(-0.5, 4.0), natural_centre(-1.0, 1.5), natural_centre(None, None)
        (1.75, 0.0, 0.0)
    """
    low, high = (end if end is not None and isfinite(end) else None for end in (lower, upper))
    if low is not None and high is not None:
        return (low + high) / 2 if max(abs(low), abs(high)) > pi - NEAR and high - low < 2 * pi else 0.0
    if low is not None:
        return low + pi - ROOM
    return 0.0 if high is None else high - pi + ROOM


def told(angle: Expr, centre: float) -> Expr:
    """An angle in [-pi, pi] as it is told about a centre: in [centre - pi, centre + pi]."""
    if centre == 0:
        return angle
    return ca.atan2(ca.sin(angle - centre), ca.cos(angle - centre)) + centre


def outside(value: float, centre: float) -> str:
    """What is wrong with an angle that is never told; nothing if it can be."""
    if abs(value - centre) <= pi:
        return ""
    low, high = centre - pi, centre + pi
    return f"angles of this joint lie between {low:.4g} and {high:.4g} rad (half a turn about its centre, {centre:.4g})"
