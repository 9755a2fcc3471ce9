"""Persistent forces of joints: those of a substep that are stored, and their effect on bodies in the next one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.configuration_update import JointCorrection, RotorCorrection
from symphys.dynamics.articulated.forward_dynamics import Wrench, consistent
from symphys.dynamics.articulated.generalized_coordinates import GeneralizedCoordinates, rotor_rates
from symphys.dynamics.articulated.rotors import Rates
from symphys.dynamics.contact.constraint import ContactConstraint
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.joints.assembly import LIMITS, JointConstraint, own
from symphys.dynamics.joints.coordinate_constraint import CoordinateConstraint
from symphys.dynamics.joints.joint_frames import free, joint_frames_at, locked
from symphys.dynamics.joints.joint_impulse import JointImpulse
from symphys.dynamics.joints.locked_directions import LockConstraint, in_world
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import AllVelocities, Momenta, Momentum, PlacedConstraint
from symphys.model.joints import Joint, JointCoupling, kinematic_trees, tree_joints
from symphys.model.state_layout import COUPLED, force_names
from symphys.model.world import World
from symphys.types import Expr

Struck = Mapping[frozenset[int], Expr]
"""For each set of bodies connected by joints 1 if one of their contacts is an impact."""
Total = list[Wrench]
"""Force and torque on each body."""
Rotors = dict[int, Rates]
"""Rates of the rotors of each tree, by its root."""
Poses = Sequence[tuple[Expr, Expr]]
"""Positions and orientations."""


def components(world: World) -> list[frozenset[int]]:
    """Return the bodies that hang together by joints."""
    found = [frozenset((i,)) for i in range(len(world.bodies))]
    for joint in world.joints:
        touched = [group for group in found if group & set(joint.bodies)]
        found = [group for group in found if group not in touched] + [frozenset().union(*touched)]
    return found


def lasting_forces(
    context: StepContext,
    contacts: Sequence[PlacedConstraint],
    joints: Sequence[JointConstraint],
    given: Sequence[JointImpulse],
    solved: AllVelocities,
    x: State,
    kick: Expr,
) -> tuple[Struck, State]:
    """Return the components that an impact struck, and the lasting forces of ``joints`` from impulses ``given``.

    ``solved``: the velocities after the sweeps.
    """
    struck = _struck(context, contacts, joints, given)
    return struck, _lasting_forces(context, joints, given, struck, solved, x, kick)


def limit_impacts(context: StepContext, joints: Sequence[JointConstraint], given: Sequence[JointImpulse]) -> Struck:
    """Return for each component with limits 1 if one of these is struck: then its contacts hold an impact, too."""
    limited = {body for each in joints if each.name.rpartition(".")[2] in LIMITS for body in each.placed.bodies}
    found = _struck(context, (), joints, given)
    return {group: impact for group, impact in found.items() if group & limited}


def _struck(
    context: StepContext,
    contacts: Sequence[PlacedConstraint],
    joints: Sequence[JointConstraint],
    given: Sequence[JointImpulse],
) -> Struck:
    """Return for each component 1 if a contact or limit of it is an impact, whose joint forces do not last."""
    found = {}
    for group in components(context.world):
        touching = tuple(each.constraint for each in contacts if group & set(each.bodies))
        limits = tuple(
            (each.placed.constraint, impulse)
            for each, impulse in zip(joints, given, strict=True)
            if group & set(each.placed.bodies) and each.name.rpartition(".")[2] in LIMITS
        )
        found[group] = _any_struck(touching, limits)
    return found


@traced
def _any_struck(
    constraints: tuple[ContactConstraint, ...], limits: tuple[tuple[CoordinateConstraint, JointImpulse], ...]
) -> Expr:
    struck = [ca.fmax(constraint.struck, constraint.leaving > 0) for constraint in constraints]
    struck += [ca.logic_and(constraint.landing, impulse.numbers != 0) for constraint, impulse in limits]
    return ca.mmax(ca.vertcat(ca.SX(0), *struck))


def _lasting_forces(
    context: StepContext,
    constraints: Sequence[JointConstraint],
    given: Sequence[JointImpulse],
    struck: Struck,
    solved: AllVelocities,
    x: State,
    kick: Expr,
) -> State:
    """Return persistent forces of constraints that sweeps project.

    In a substep with an impact those of the last one stay: what held the impact is not to be told from them.
    """
    forces = dict[str, list[Expr]]()
    for each, impulse in zip(constraints, given, strict=True):
        if isinstance(each.placed.constraint, LockConstraint) and each.placed.constraint.lasting is not None:
            moving = tuple(solved[i] for i in each.placed.carriers)
            forces[each.name] = [_sprung(each.placed.constraint, moving, impulse)]
            continue
        constraint, impact, old = each.placed.constraint, of_body(struck, each.placed.bodies[0]), x[each.name]
        force = _lasting(constraint, impulse, own(old, each.k), impact, (kick, x["lag"], context.shortest_kick))
        forces.setdefault(each.name, []).append(force)
    return {name: _stacked(tuple(parts)) for name, parts in forces.items()}


def impulses_along(world: World, constraints: Sequence[JointConstraint], given: Sequence[JointImpulse]) -> State:
    """Return the impulses (k,) of ``force_names`` in a substep from those ``given`` to constraints."""
    names, parts = {name for name, _ in force_names(world)}, dict[str, list[Expr]]()
    for each, impulse in zip(constraints, given, strict=True):
        if each.name in names:
            parts.setdefault(each.name, []).append(each.placed.constraint.stored_form(impulse))
    return {name: _stacked(tuple(each)) for name, each in parts.items()}


def motor_impulses(
    constraints: Sequence[JointConstraint], given: Sequence[JointImpulse], kick: Expr, lag: Expr
) -> State:
    """Return the impulses (k,) of motors that a command drives, as if it had acted over all of ``kick`` [s]."""
    parts = dict[str, list[Expr]]()
    for each, impulse in zip(constraints, given, strict=True):
        constraint = each.placed.constraint
        if isinstance(constraint, CoordinateConstraint) and constraint.drive is not None:
            parts.setdefault(each.name, []).append(_driven(constraint, impulse, kick, lag))
    return {name: _stacked(tuple(each)) for name, each in parts.items()}


@traced
def _driven(constraint: CoordinateConstraint, impulse: JointImpulse, kick: Expr, lag: Expr) -> Expr:
    if constraint.jump is None:
        return kick * constraint.drive
    return constraint.bounded(constraint.stored_form(impulse) + lag * constraint.jump)


@traced
def _sprung(constraint: LockConstraint, momenta: tuple[Any, ...], impulse: JointImpulse) -> Expr:
    return constraint.stored_form(constraint.at_end(momenta, impulse))


def of_body(struck: Struck, body: int) -> Expr:
    """Return 1 if the component of a body is struck, else 0."""
    return next(impact for group, impact in struck.items() if body in group)


@traced
def _lasting(
    constraint: LockConstraint | CoordinateConstraint,
    impulse: JointImpulse,
    old: Expr,
    struck: Expr,
    times: tuple[Expr, Expr, Expr],
) -> Expr:
    """Return the force.

    Of what a command gives the last one, although its impulse began with that of the step before.
    """
    kick, lag, shortest = times
    given = constraint.stored_form(impulse)
    if isinstance(constraint, CoordinateConstraint) and constraint.drive is not None:
        if constraint.jump is None:
            return constraint.drive
        given = constraint.bounded(given + lag * constraint.jump)
        old = constraint.bounded(kick * (old + constraint.jump)) / kick
    return ca.if_else(struck, old, given / ca.fmax(kick, shortest))


def commanded(context: StepContext, joints: Sequence[JointConstraint], forces: State) -> State:
    """Return the force of commands by themselves; it acts until the next step, whatever the sweeps start from."""
    found, owner = State(), {joint.name: joint for joint in context.world.joints}
    drives = dict[str, list[Expr]]()
    for each in joints:
        drive = getattr(each.placed.constraint, "drive", None)
        if drive is not None:
            drives.setdefault(each.name, []).append(drive)
    for name, parts in drives.items():
        joint = owner[name.rpartition(".")[0]]
        found[f"{joint.name}.{joint.drive}"] = forces[name] if joint.drive == "motor" else _stacked(tuple(parts))
    return found


@traced
def _stacked(parts: tuple[Expr, ...]) -> Expr:
    return ca.vertcat(*parts)


def add_joint_forces(context: StepContext, forces: State, poses: Poses, total: Total) -> None:
    """Add to ``total`` what joint forces do to bodies; see ``joint_wrenches``."""
    for joint, wrenches in joint_wrenches(context, forces, poses):
        for body, wrench in zip(joint.bodies, wrenches, strict=True):
            total[body] = _added(total[body], wrench)


def joint_wrenches(context: StepContext, forces: State, poses: Poses) -> Iterator[tuple[Joint, tuple[Wrench, ...]]]:
    """Yield joints, with a force and a torque on each of their bodies at these poses; one joint may come repeatedly.

    ``forces`` has the entries of joints in a state, their ``unwrapped`` angles too. The wrenches are those of motors,
    limits, springs, friction and couplings, and of the locks of joints that close loops or are soft.
    What the joints of trees lock is left out: it does nothing along the free motions of the tree.
    """
    exact = tree_joints(context.world.joints)
    for index, joint in enumerate(context.world.joints):
        names = joint.acting if index in exact else ("lock", *joint.acting)
        if names:
            parts = tuple((part, forces[f"{joint.name}.{part}"]) for part in names)
            yield joint, on_bodies(joint, tuple(poses[i] for i in joint.bodies), parts)
    for coupling in context.world.couplings:
        yield from _coupling_wrenches(context, coupling, forces, poses)


def _coupling_wrenches(
    context: StepContext, coupling: JointCoupling, forces: State, poses: Poses
) -> Iterator[tuple[Joint, tuple[Wrench, ...]]]:
    """Yield what a coupling does: its force along the coordinate that follows, and against it along the other."""
    force = forces[f"{coupling.name}.{COUPLED}"]
    joints = [context.world.joints[k] for k in (coupling.first, coupling.second) if k is not None]
    held = [tuple(poses[i] for i in joint.bodies) for joint in joints]
    near = [ca.SX(0, 1) if joint.unwrapped is None else forces[joint.unwrapped] for joint in joints]
    along = [force] if len(joints) == 1 else [force, _against(coupling, joints[1], held[1], near[1], force)]
    for joint, sides, numbers in zip(joints, held, along, strict=True):
        yield joint, on_bodies(joint, sides, (("motor", numbers),))


@traced
def _against(
    coupling: JointCoupling, joint: Joint, poses: tuple[tuple[Expr, Expr], ...], near: Expr, force: Expr
) -> Expr:
    value = joint.value(0, joint_frames_at(joint, poses).placed(ca.SX(0)), near)
    return -coupling.slope(value) * force


@traced
def on_bodies(
    joint: Joint, poses: tuple[tuple[Expr, Expr], ...], parts: tuple[tuple[str, Expr], ...]
) -> tuple[tuple[Expr, Expr], ...]:
    """Return force and torque on each moving side."""
    frames, now = joint_frames_at(joint, poses), ca.SX(0)
    placed, arms = frames.placed(now), frames.common_arms(now)
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for part, numbers in parts:
        if part == "lock" and not joint.kind.travels:
            numbers = in_world(placed.a, numbers)
        along = [locked(joint, placed)] if part == "lock" else [free(c, placed) for c in joint.kind.coordinates]
        columns = [numbers] if part == "lock" else ca.vertsplit(numbers)
        for directions, values in zip(along, columns, strict=True):
            force, torque = directions.split(values)
            linear, angular = linear + force, angular + torque
    first = linear, ca.cross(arms[0], linear) + angular
    second = -linear, -ca.cross(arms[1], linear) - angular
    return (first, second)[: len(poses)]


@traced
def _added(total: tuple[Expr, Expr], wrench: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
    return total[0] + wrench[0], total[1] + wrench[1]


def keep_momentum(
    context: StepContext, momenta: Momenta, made: Mapping[int, JointCorrection], struck: Struck, duration: Expr
) -> Momenta:
    """Return the momenta, with those of the displacements by joints (as in SHAKE), so that spin is kept.

    Not those by loops in a substep with an impact, where they make up for impulses that act late. They are no part of
    the forces that the next sweeps start from.
    """
    found, dt = list(momenta), context.settings.scheme.dt
    for i, more in made.items():
        found[i] = _kept_up(momenta[i], more, of_body(struck, i), duration, dt)
    return tuple(found)


@traced
def _kept_up(momentum: Momentum, made: JointCorrection, impact: Expr, duration: Expr, dt: Expr) -> Momentum:
    velocity, angular = made.by_tree.velocity, made.by_tree.angular
    if made.by_loops is not None:
        velocity += ca.if_else(impact, 0, made.by_loops.velocity)
        angular += ca.if_else(impact, 0, made.by_loops.angular)
    share = duration / dt**2
    return Momentum(momentum.velocity + share * velocity, momentum.angular + share * angular)


def keep_rotors(
    context: StepContext,
    coordinates: Sequence[GeneralizedCoordinates],
    solved: AllVelocities,
    turned: Mapping[int, RotorCorrection],
    struck: Struck,
    duration: Expr,
) -> Rotors:
    """Return the rates of rotors, with those that the displacements by joints stand for; see ``keep_momentum``."""
    dt, found = context.settings.scheme.dt, Rotors()
    for tree, each in zip(kinematic_trees(context.world.joints), coordinates, strict=True):
        root, more = tree.root, turned[tree.root]
        rates = rotor_rates(each, solved[root])
        loops = more.by_loops or (None,) * len(rates)
        impact = of_body(struck, root)
        found[root] = tuple(
            None if rate is None else _turned(rate, by_tree, by_loops, impact, duration, dt)
            for rate, by_tree, by_loops in zip(rates, more.by_tree, loops, strict=True)
        )
    return found


@traced
def _turned(rate: Expr, by_tree: Expr, by_loops: Expr | None, impact: Expr, duration: Expr, dt: Expr) -> Expr:
    made = by_tree if by_loops is None else by_tree + ca.if_else(impact, 0, by_loops)
    return rate + duration / dt**2 * made


def project_velocities(
    context: StepContext,
    momenta: Sequence[Momentum],
    poses: Poses,
    velocities: Sequence[tuple[Expr, Expr]],
    rotors: Rotors,
) -> list[tuple[Expr, Expr]]:
    """Return velocities and angular velocities; those of trees as they fit their joints at these poses.

    Args:
        context: what is simulated.
        momenta: of the bodies.
        poses: of the bodies.
        velocities: of bodies that are not part of a tree.
        rotors: the rates of those of trees.
    """
    found, joints = list(velocities), context.world.joints
    for tree in kinematic_trees(joints):
        along = tuple(None if link.joint is None else joints[link.joint] for link in tree.links)
        bodies = [context.world.bodies[i] for i in tree.bodies]
        inertials = tuple((body.mass, body.inertia) for body in bodies)
        parts = tuple(poses[i] for i in tree.bodies), tuple(momenta[i] for i in tree.bodies)
        for i, fits in zip(tree.bodies, consistent(tree, along, inertials, *parts, rotors[tree.root]), strict=True):
            found[i] = fits
    return found
