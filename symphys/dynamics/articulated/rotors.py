"""Rotors of motors: the inertia that each adds to its joint's coordinates, and its rate.

A rotor turns with its coordinate, seen through its gear, so it adds a number to the diagonal of the tree's mass matrix
and has a momentum of its own, armature times rate (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 9).
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.articulated.branches import Tree
from symphys.dynamics.articulated.schur_complement import Columns
from symphys.dynamics.articulated.spatial import Joints
from symphys.dynamics.motion import PredictedMotion
from symphys.dynamics.tracing.decorator import traced
from symphys.model.joints import Joint, KinematicTree
from symphys.model.scalar import is_zero
from symphys.types import Expr

Rates = tuple[Expr | None, ...]
"""Rates of the rotors of each link (count,); None without a rotor."""


def has_rotor(joint: Joint | None) -> bool:
    """Whether a joint has armature; a matter of structure."""
    return joint is not None and not is_zero(joint.armature)


def armatures(kinematic_tree: KinematicTree, joints: Joints) -> tuple[Expr | None, ...]:
    """Return for each link its term on the diagonal of the mass matrix [kg m^2] or [kg]; None without one."""
    return tuple(
        ca.SX(joint.armature) if joint is not None and has_rotor(joint) and link.count else None
        for link, joint in zip(kinematic_tree.links, joints, strict=True)
    )


def joint_rates(tree: Tree, joints: Joints, motions: Sequence[PredictedMotion]) -> Rates:
    """Return the rates of links with rotors from the velocities of the bodies at the start of the motions."""
    place, found = {link.body: k for k, link in enumerate(tree.kinematic_tree.links)}, list[Expr | None]()
    for k, (link, joint) in enumerate(zip(tree.kinematic_tree.links, joints, strict=True)):
        if joint is None or tree.armature[k] is None:
            found.append(None)
            continue
        parent = None if link.parent is None else motions[place[link.parent]]
        against = None if parent is None else _moving(parent)
        found.append(_rate(joint.kind.turning, tree.impulses[k], _moving(motions[k]), against))
    return tuple(found)


def _moving(motion: PredictedMotion) -> tuple[Expr, Expr, Expr]:
    return motion.position, motion.velocity, motion.angular_velocity


@traced
def _rate(turning: bool, axes: Expr, own: tuple[Expr, Expr, Expr], parent: tuple[Expr, Expr, Expr] | None) -> Expr:
    """Return the rates (count,) of a joint; its turning axes are perpendicular, and a sliding axis is single."""
    place, velocity, spin = own
    if parent is not None:
        velocity = velocity - parent[1] - ca.cross(parent[2], place - parent[0])
        spin = spin - parent[2]
    return ca.mtimes(axes[:3, :].T, spin) if turning else ca.mtimes(axes[3:, :].T, velocity)


def select_rotors(tree: Tree, rates: Columns) -> Rates:
    """Select the rates of links that have rotors."""
    return tuple(None if armature is None else rate for armature, rate in zip(tree.armature, rates, strict=True))
