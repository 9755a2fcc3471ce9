"""What the joints of a tree gave, from what happened to its bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.joints import Joint, Linkage
from symphys.motion import Motion
from symphys.step.momentum import Momentum
from symphys.step.sockets import sockets_of

Expr = Any
"""casadi SX"""


def wrenches(
    linkage: Linkage, joints: Sequence[Joint | None], motions: Sequence[Motion], given: Sequence[Momentum]
) -> tuple[Expr, ...]:
    """(6,) each: impulse [N s] and couple impulse [N m s] of the joint of each link, on the joint's first side.

    Along the axes of the first side's socket at the start of the stretch, about the common point; of a link without a
    joint an empty column. ``given``: linear [N s] and angular impulse about the centre of mass that joints gave to each
    body, motors and limits among them. From the leaves: what a body got, and what it passed on.
    """
    place = {link.body: k for k, link in enumerate(linkage.links)}
    linear = [momentum.velocity for momentum in given]
    angular = [momentum.angular for momentum in given]
    found: list[Expr] = [ca.SX(0, 1) for _ in given]
    for k in reversed(range(len(given))):
        link, joint = linkage.links[k], joints[k]
        if joint is None:
            continue
        above = () if link.parent is None else (motions[place[link.parent]],)
        sides = (motions[k], *above) if link.sign > 0 else (*above, motions[k])
        sockets = sockets_of(joint, sides)
        arms = sockets.common_arms(ca.SX(0))
        own, other = arms if link.sign > 0 else arms[::-1]
        couple = angular[k] - ca.cross(own, linear[k])
        if link.parent is not None:
            parent = place[link.parent]
            linear[parent] = linear[parent] + linear[k]
            angular[parent] = angular[parent] + ca.cross(other, linear[k]) + couple
        axes = sockets.placed(ca.SX(0)).a
        found[k] = link.sign * ca.vertcat(ca.mtimes(axes.T, linear[k]), ca.mtimes(axes.T, couple))
    return tuple(found)
