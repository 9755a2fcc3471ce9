"""When a simulated motion has impacts: steps over which a body's velocity jumps."""

from __future__ import annotations

import numpy as np

from symphys.types import Array

JUMP = 0.1
"""Share of the greatest speed of a body in a motion by which its velocity jumps at an impact, at least."""
FALLS = 3.0
"""And by so many times what gravity changes in a step: bodies that come to rest or rock have no impacts."""
WITHIN = 1e-6
"""Steps: an impact is counted from just after the start of its step, so that a sample there is before it."""


def impact_times(velocity: Array, gravity: Array, dt: float) -> Array:
    """(i,) [s] when the steps begin that have an impact, of velocities (n, bodies, 3) [m/s] at the starts of n steps.

    An impact changes a velocity by more than gravity (3,) [m/s^2] and by another amount than the step before, so that
    motors and springs, which act over many steps, make none. The first step has none: nothing is before it.
    """
    change = np.diff(velocity, axis=0) - gravity * dt
    speed = np.max(np.linalg.norm(velocity, axis=2), axis=0, initial=0.0)
    least = np.maximum(JUMP * speed, FALLS * float(np.linalg.norm(gravity)) * dt)
    jumps = np.linalg.norm(np.diff(change, axis=0, prepend=change[:1]), axis=2) > least
    struck = np.any(jumps & (np.linalg.norm(change, axis=2) > least) & (least > 0), axis=1)
    return np.asarray((np.flatnonzero(struck) + WITHIN) * dt, np.float64)
