"""Joints within a substep: their trees and constraints, what these start from, and what is stored of what they gave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.generalized_coordinates import (
    GeneralizedCoordinates,
    body_momenta,
    generalized_coordinates,
)
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.joints.coordinate_constraint import CoordinateConstraint
from symphys.dynamics.joints.joint_constraints import (
    CONSTRAINTS,
    Command,
    CoordinateTerms,
    SubstepTimes,
    coordinate_terms,
    coordinate_value,
    coupling_constraint,
    lock_at_impact,
    lock_constraint,
)
from symphys.dynamics.joints.joint_frames import JointFrames, joint_frames
from symphys.dynamics.joints.joint_impulse import JointImpulse
from symphys.dynamics.joints.locked_directions import LockConstraint
from symphys.dynamics.motion import PredictedMotion
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import AllVelocities, Momenta, PlacedConstraint, Velocities
from symphys.model.joints import Joint, JointCoupling, carriers, kinematic_trees, tree_joints
from symphys.model.state_layout import COUPLED
from symphys.model.world import World
from symphys.records import dataclass
from symphys.types import Expr

LIMITS = ("lower", "upper")


@dataclass(frozen=True)
class KinematicTrees:
    """The trees of a world over a substep.

    Attributes:
        coordinates: in the order of ``kinematic_trees``.
        motions: of all bodies, those of trees with how they are held.
        states: what the sweeps start from, without any impulse of the substep.
        carriers: for each body where the sweeps keep what they know of it.
        roots: the body at which each tree's velocities are kept.
    """

    coordinates: tuple[GeneralizedCoordinates, ...]
    motions: tuple[PredictedMotion, ...]
    states: AllVelocities
    carriers: tuple[int, ...]
    roots: tuple[int, ...] = ()

    def placed(self, bodies: tuple[int, ...], constraint: Any) -> PlacedConstraint:
        """Return a constraint on these bodies."""
        return PlacedConstraint(bodies, constraint, tuple(self.carriers[i] for i in bodies))

    def same(self, bodies: tuple[int, ...]) -> bool:
        """Whether both are of one tree."""
        return len(bodies) == 2 and self.carriers[bodies[0]] == self.carriers[bodies[1]]


def prepare_trees(
    context: StepContext, motions: Sequence[PredictedMotion], free: Momenta, middle: Expr
) -> KinematicTrees:
    """Return the trees; ``free``: momenta of all bodies without any impulse of the substep."""
    joints, moving = context.world.joints, list(motions)
    states: list[Velocities] = list(free)
    found, touched = list[GeneralizedCoordinates](), _touched(context.world)
    coupled = {k for each in context.world.couplings for k in (each.first, each.second) if k is not None}
    # each tree: its coordinates replace the velocities of its bodies
    for tree in kinematic_trees(joints):
        own = tuple(None if link.joint is None else joints[link.joint] for link in tree.links)
        reached = tuple(body in touched for body in tree.bodies)
        parts = tuple(motions[i] for i in tree.bodies), tuple(free[i] for i in tree.bodies)
        acting = tuple(link.joint in coupled or _acts(joint) for link, joint in zip(tree.links, own, strict=True))
        coordinates = generalized_coordinates(tree, own, reached, *parts, middle, acting)
        found.append(coordinates)
        for body, jacobian in zip(tree.bodies, coordinates.jacobians, strict=True):
            moving[body], states[body] = replace(motions[body], jacobian=jacobian), None
        states[tree.root] = coordinates.free
    roots = tuple(tree.root for tree in kinematic_trees(joints))
    return KinematicTrees(tuple(found), tuple(moving), tuple(states), carriers(len(motions), joints), roots)


def _acts(joint: Joint | None) -> bool:
    """Whether anything acts along a joint's coordinates."""
    return joint is not None and bool(joint.acting)


def _touched(world: World) -> set[int]:
    """Return bodies on which contacts act, or joints that close loops or are soft."""
    exact = tree_joints(world.joints)
    sides = {side.body for pair in world.pairs for side in (pair.first, pair.second)}
    loose = {body for k, joint in enumerate(world.joints) if k not in exact for body in joint.bodies}
    return {body for body in sides if body is not None} | loose


def momenta_of(context: StepContext, trees: KinematicTrees, solved: AllVelocities) -> Momenta:
    """Return the momenta of all bodies from the velocities that the sweeps keep."""
    found = list(solved)
    for tree, coordinates in zip(kinematic_trees(context.world.joints), trees.coordinates, strict=True):
        momenta = body_momenta(coordinates, solved[tree.root])
        for body, momentum in zip(tree.bodies, momenta, strict=True):
            found[body] = momentum
    return tuple(found)  # type: ignore[arg-type]


@dataclass(frozen=True)
class JointConstraint:
    """A constraint of a joint.

    Attributes:
        placed: what sweeps, or the position pass, project.
        name, k: where the state keeps what it gave: component ``k`` of ``name``, all of it if None.
    """

    placed: PlacedConstraint
    name: str
    k: int | None = None


@dataclass(frozen=True)
class JointPath:
    """A joint over a substep: its frames on the predicted paths of its bodies, and its coordinates at the start."""

    frames: JointFrames
    values: tuple[Expr, ...]


def joint_paths(context: StepContext, x: State, paths: Sequence[PredictedMotion]) -> list[JointPath]:
    """Return the paths of all joints in a substep from x."""
    found = []
    for joint in context.world.joints:
        frames = joint_frames(joint, tuple(paths[i] for i in joint.bodies))
        near = ca.SX(0, 1) if joint.unwrapped is None else x[joint.unwrapped]
        values = (coordinate_value(frames, k, near) for k in range(len(joint.kind.coordinates)))
        found.append(JointPath(frames, tuple(values)))
    return found


def joint_constraints(
    context: StepContext, x: State, trees: KinematicTrees, paths: Sequence[PredictedMotion], duration: Expr, kick: Expr
) -> tuple[list[JointPath], list[JointConstraint], list[PlacedConstraint]]:
    """Return the paths of all joints over a substep from x, the constraints of the sweeps and of the position pass."""
    settings, substep = context.settings, SubstepTimes(duration, kick)
    projected, fitted = list[JointConstraint](), list[PlacedConstraint]()
    places, along = _places(context.world, trees), joint_paths(context, x, paths)
    # locks (25) of joints that are no tree's, then motors, limits, springs and friction (26)
    for index, joint in enumerate(context.world.joints):
        moving = tuple(trees.motions[i] for i in joint.bodies)
        frames, same = along[index].frames, trees.same(joint.bodies)
        if index not in places:
            near = _stacked(along[index].values) if joint.kind.screws else None
            lock = trees.placed(joint.bodies, lock_constraint(frames, moving, substep, same, near))
            projected.append(JointConstraint(lock, f"{joint.name}.lock"))
            fitted += [] if joint.soft else [lock]
        for k in range(len(joint.kind.coordinates)) if joint.acting else ():
            states = tuple(trees.states[trees.carriers[i]] for i in joint.bodies)
            value = along[index].values[k]
            at = coordinate_terms(frames, k, moving, states, duration, places.get(index, same), value)
            command = _command(context, joint, k, x)
            for part in joint.acting:
                constraint = trees.placed(joint.bodies, CONSTRAINTS[part](settings, joint, at, command, substep))
                projected.append(JointConstraint(constraint, f"{joint.name}.{part}", k))
                fitted += [constraint] if part in LIMITS else []
    # couplings of coordinates
    for coupling in context.world.couplings:
        constraint = _coupled(context, trees, along, duration, coupling, places)
        projected.append(JointConstraint(constraint, f"{coupling.name}.{COUPLED}", 0))
        fitted.append(constraint)
    return along, projected, fitted


@traced
def _stacked(values: tuple[Expr, ...]) -> Expr:
    return ca.vertcat(*values)


def _command(context: StepContext, joint: Joint, k: int, x: State) -> Command:
    """Return the command of coordinate ``k`` of a joint, and that of the step before; 0 without one."""
    given = context.input(f"{joint.name}.command")
    before = ca.SX(0) if joint.drive is None else x[f"{joint.name}.{joint.drive}"][k]
    return Command(ca.SX(0) if given is None else given[k], before)


def _coupled(
    context: StepContext,
    trees: KinematicTrees,
    paths: Sequence[JointPath],
    duration: Expr,
    coupling: JointCoupling,
    places: Mapping[int, tuple[int, Expr]],
) -> PlacedConstraint:
    """Return the constraint of a coupling."""
    terms = list[CoordinateTerms | None]()
    for index in (coupling.first, coupling.second):
        if index is None:
            terms.append(None)
            continue
        joint, path = context.world.joints[index], paths[index]
        moving = tuple(trees.motions[i] for i in joint.bodies)
        states = tuple(trees.states[trees.carriers[i]] for i in joint.bodies)
        terms.append(coordinate_terms(path.frames, 0, moving, states, duration, places[index], path.values[0]))
    assert terms[0] is not None
    bodies = context.world.joints[coupling.first].bodies
    return trees.placed(bodies, coupling_constraint(coupling, terms[0], terms[1], duration))


def _places(world: World, trees: KinematicTrees) -> dict[int, tuple[int, Expr]]:
    """Return for each joint of a tree its first coordinate and the tree's responses."""
    return {
        link.joint: (link.start, coordinates.responses)
        for tree, coordinates in zip(kinematic_trees(world.joints), trees.coordinates, strict=True)
        for link in tree.links
        if link.joint is not None
    }


def locks_at(context: StepContext, trees: KinematicTrees) -> list[tuple[PlacedConstraint, JointImpulse]]:
    """Return the constraints, without impulse, of rigid joints that close loops, at the instant of an impact."""
    found, exact = [], tree_joints(context.world.joints)
    for index, joint in enumerate(context.world.joints):
        if index in exact or joint.soft:
            continue
        moving = tuple(trees.motions[i] for i in joint.bodies)
        states = tuple(trees.states[trees.carriers[i]] for i in joint.bodies)
        frames = joint_frames(joint, moving)
        constraint = lock_at_impact(frames, moving, states, trees.same(joint.bodies))
        found.append((trees.placed(joint.bodies, constraint), JointImpulse(ca.SX(joint.kind.locked, 1))))
    return found


def warm_started(
    context: StepContext, constraints: Sequence[JointConstraint], x: State, kick: Expr
) -> list[JointImpulse]:
    """Return the start of the sweeps: the last step's forces over this substep's kick."""
    if not context.settings.scheme.warm_start:
        return [JointImpulse(ca.SX(numbers_of(each.placed.constraint), 1)) for each in constraints]
    return [_again(each.placed.constraint, x[each.name], each.k, kick) for each in constraints]


def numbers_of(constraint: LockConstraint | CoordinateConstraint) -> int:
    """Return the number of impulses of a constraint."""
    return constraint.error.leaf.rows if isinstance(constraint, LockConstraint) else 1


def own(stored: Expr, k: int | None) -> Expr:
    """Return a constraint's part of a stored column."""
    return stored if k is None else stored[k]


@traced
def _again(constraint: LockConstraint | CoordinateConstraint, stored: Expr, k: int | None, kick: Expr) -> JointImpulse:
    return constraint.from_stored(kick * own(stored, k))
