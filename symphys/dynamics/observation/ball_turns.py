"""How the two sides of a joint are turned against each other, for joints whose turns have no coordinates."""

from __future__ import annotations

import casadi as ca

from symphys.maths import rotation
from symphys.model.joints import Joint
from symphys.types import Expr

WORLD_ORIENTATION = (1.0, 0.0, 0.0, 0.0)
"""Of the world."""


def joint_turn(joint: Joint, orientations: tuple[Expr, ...], spins: tuple[Expr, ...]) -> tuple[Expr, Expr]:
    """The orientation (4,) of the joint's first frame in its second, and the angular velocity (3,) [rad/s] there.

    Args:
        joint: of the world.
        orientations: (4,) of its bodies in the order of ``Joint.bodies``.
        spins: (3,) [rad/s] their angular velocities, world frame.
    """
    first, second = ((*orientations, ca.DM(WORLD_ORIENTATION))[k] for k in (0, 1))
    own, other = (
        rotation.multiply(q, ca.vertcat(*frame.orientation))
        for q, frame in zip((first, second), joint.frames, strict=True)
    )
    back = ca.vertcat(other[0], -other[1:4])
    apart = spins[0] - spins[1] if len(spins) > 1 else spins[0]
    return rotation.multiply(back, own), rotation.rotate(back, apart)
