"""Heights of a ball that is dropped and bounces, in closed form."""

from __future__ import annotations

import numpy as np

from symphys.types import Array


def bouncing_height(time: Array, height: float, radius: float, restitution: float, gravity: float = 9.81) -> Array:
    """(n,) [m]: of the centre of a ball let go at ``height`` at 0 s; each bounce leaves a share of its speed."""
    found = height - gravity * time**2 / 2
    touch = np.sqrt(2 * (height - radius) / gravity)
    speed = restitution * gravity * touch
    while touch < time[-1] and speed > 1e-3:
        after = time - touch
        found = np.where(after > 0, radius + speed * after - gravity * after**2 / 2, found)
        touch, speed = touch + 2 * speed / gravity, restitution * speed
    return found
