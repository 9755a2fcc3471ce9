"""A substep of time: free motion, constraints, sweeps, positions, and the state at its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.applied import Wrench
from symphys.dynamics.arguments import law_as_arguments
from symphys.dynamics.articulated.forward_kinematics import FinalPose
from symphys.dynamics.collision import Contact
from symphys.dynamics.collision.contact_geometry import Displacement
from symphys.dynamics.contact.constraint import ZERO_IMPULSE, ContactConstraint, ContactImpulse
from symphys.dynamics.contact.coupling import coupled_pairs
from symphys.dynamics.contact.preparation import SubstepFlags, prepare
from symphys.dynamics.contact.warm_start import apply_start, distribute_loads, warm_impulses, within_energy
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.free_rotation import turned
from symphys.dynamics.joints.assembly import (
    JointConstraint,
    joint_constraints,
    momenta_of,
    prepare_trees,
    warm_started,
)
from symphys.dynamics.joints.loop_closure import TreeDisplacement
from symphys.dynamics.joints.warm_start import (
    Rotors,
    Struck,
    add_joint_forces,
    commanded,
    impulses_along,
    keep_momentum,
    keep_rotors,
    lasting_forces,
    limit_impacts,
    motor_impulses,
    project_velocities,
)
from symphys.dynamics.motion import PredictedMotion, angular_velocity, apply, isotropic
from symphys.dynamics.pgs import iterate
from symphys.dynamics.position_correction import CorrectedConfiguration, close_gaps, displacements, unwrapped_angles
from symphys.dynamics.prediction import bodies_of, detect_contacts, free_motions, jointed_bodies, predicted_motions
from symphys.dynamics.tracing.decorator import contiguous, traced
from symphys.dynamics.unknowns import AllVelocities, Iterate, Momenta, Momentum, PlacedConstraint
from symphys.maths import rotation
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.state_layout import BODY_FIELDS
from symphys.records import dataclass
from symphys.types import Expr

ZERO = ca.SX(0)
SLIDING_SHARE = 0.999
"""Surfaces count as sliding from this share of the largest friction on."""
ZERO_MOMENTUM = Momentum(ca.SX.zeros(3), ca.SX.zeros(3))


@dataclass(frozen=True)
class Substep:
    """A substep that has been advanced.

    Attributes:
        x: the state at its end.
        constraints, contacts: of the pairs.
        impulses: accumulated, of the pairs.
        changes: of every constraint, joints too, its accumulated impulse, and that before the final sweep.
        by_joints: impulses (k,) along coordinates, by the name of the force in the state ("hip.motor") [N m s], [N s].
        of_motors: those of motors, as if a command had acted for the whole time of the impulse.
        ahead: (3,) each [N s]: impulses of persistent forces over the lag, which the true velocities have ahead of the
            sweeps'. The next substep takes them off again, except after an impact, where leapfrog begins anew.
        chained: 1 if impacts were left to the next step.
    """

    x: State
    constraints: tuple[PlacedConstraint, ...]
    contacts: tuple[Contact, ...]
    impulses: tuple[ContactImpulse, ...]
    changes: tuple[tuple[Any, Any], ...]
    by_joints: State
    of_motors: State
    ahead: tuple[Expr, ...] = ()
    chained: Expr = ZERO


def advance(
    context: StepContext, x: State, duration: Expr, suppressed: Sequence[Expr] = (), plastic: Expr = ZERO
) -> Substep:
    """Return the state after ``duration`` [s]; numbers are those of the equations in docs/time_step.md.

    Pairs whose ``suppressed`` is 1 give no impulse, since the substep ends as they meet. Where ``plastic`` is 1 nothing
    rebounds.
    """
    world = context.world
    kick, half = _times(duration, x["lag"])  # (2)

    # 1-2. predicted motion: free (1, 3, 4); of bodies with joints as the forces of the last step have it (5)
    motions = free_motions(context, x, duration)
    paths = predicted_motions(context, x, duration) if world.joints else motions
    free = tuple(Momentum(motion.mid_velocity, motion.mid_momentum) for motion in motions)
    trees = prepare_trees(context, paths, free, half)

    # 3. contacts along the predicted paths (6)
    contacts = detect_contacts(context, paths, duration)

    # 4. constraints of contacts (7-13) and of joints (25, 26)
    suppressed = suppressed or [ca.SX(0)] * len(contacts)
    constraints, couple = list[PlacedConstraint](), coupled_pairs(world)
    for (pair, near), contact, off, coupled in zip(context.pairs_and_near(), contacts, suppressed, couple, strict=True):
        bodies = bodies_of(pair)
        moving, force = tuple(trees.motions[i] for i in bodies), x[f"{pair.name}.force"]
        same, lagging = trees.same(bodies), _lagging(context, x, bodies)
        conditions = SubstepFlags(off, plastic, force, same, coupled, near, lagging, x["lag"])
        constraint = prepare(context.settings, law_as_arguments(pair.law), contact, moving, duration, conditions)
        constraints.append(trees.placed(bodies, constraint))
    jointed, joints, fitted = joint_constraints(context, x, trees, paths, duration, kick)

    # 5-6. velocities: warm start (16), then projections (14, 15, 17)
    given = distribute_loads(context, constraints, warm_impulses(context, constraints, x, kick))
    every = (*(each.placed for each in joints), *constraints)
    states = contiguous(trees.states) if context.near else trees.states
    start = apply_start(every[: len(joints)], states, warm_started(context, joints, x, kick))
    given = within_energy(context, constraints, start.momenta, given)
    pressed = apply_start(constraints, start.momenta, given)
    start = Iterate(pressed.momenta, (*start.impulses, *given), (*start.impulses, *given))
    solved = iterate(context, every, start, trees)
    by_joints, impulses = solved.impulses[: len(joints)], solved.impulses[len(joints) :]
    momenta = momenta_of(context, trees, solved.momenta)

    # 7. positions: displacements (18), then what still overlaps (19)
    moved = displacements(context, trees, constraints, given, solved.momenta, impulses, duration)
    closed = close_gaps(context, trees, list(zip(constraints, contacts, impulses, strict=True)), fitted, moved)
    poses, momenta = _poses(context, motions, moved, closed, momenta)

    # 8. what is stored: persistent forces (20), velocities (21)
    values: State = {"lag": half}
    (whole, momenta), rotors = _with_late_impulses(constraints, impulses, momenta), Rotors()
    impacts = limit_impacts(context, joints, by_joints)
    reactions = _store_forces(context, constraints, impulses, solved.momenta, kick, values, x, impacts)
    if world.joints:
        struck, forces = lasting_forces(context, constraints, joints, by_joints, solved.momenta, x, kick)
        angles = unwrapped_angles(context, jointed, closed, duration)
        add_joint_forces(context, forces | angles, poses, reactions)
        momenta = keep_momentum(context, momenta, closed.made, struck, duration)
        rotors = keep_rotors(context, trees.coordinates, solved.momenta, closed.turned, struck, duration)
        values |= _stored_joint_forces(context, joints, forces) | angles
    values |= _moving_bodies(context, motions, momenta, reactions, poses, rotors)
    changes = zip(solved.impulses, solved.last, strict=True)
    along = impulses_along(context.world, joints, by_joints)
    motors = along | motor_impulses(joints, by_joints, kick, x["lag"])
    return Substep(values, tuple(constraints), tuple(contacts), whole, tuple(changes), along, motors)


def _poses(
    context: StepContext,
    motions: Sequence[PredictedMotion],
    moved: Sequence[TreeDisplacement],
    closed: CorrectedConfiguration,
    momenta: Momenta,
) -> tuple[list[tuple[Expr, Expr]], Momenta]:
    """Return the poses of all bodies at the end of the substep, and momenta that turn with pushes."""
    poses, turned = list[tuple[Expr, Expr]](), list(momenta)
    jointed = jointed_bodies(context.world)
    for k, motion in enumerate(motions):
        if k in closed.arrived:
            poses.append(_tree_pose(motion, closed.arrived[k]))
            continue
        shift = closed.shifts[k]
        if k in jointed or isotropic(context.world.bodies[k].inertia):
            poses.append(_pose(motion, shift))
        else:
            pose, turned[k] = _free_pose(motion, moved[k], shift, momenta[k])
            poses.append(pose)
    return poses, tuple(turned)


def _moving_bodies(
    context: StepContext,
    motions: Sequence[PredictedMotion],
    momenta: Momenta,
    reactions: Sequence[tuple[Expr, Expr]],
    poses: Sequence[tuple[Expr, Expr]],
    rotors: Rotors,
) -> State:
    """Return the fields of all bodies at the end of the substep; of a frame only what acts on it counts."""
    values = State()
    counted = [ZERO_MOMENTUM if motion.massless else each for motion, each in zip(motions, momenta, strict=True)]
    ended = [_end_momentum(*parts) for parts in zip(motions, counted, reactions, strict=True)]
    apart = [_velocities(*parts) for parts in zip(motions, ended, poses, strict=True)]
    moving = project_velocities(context, ended, poses, apart, rotors)
    for body, pose, velocities, reaction in zip(context.world.bodies, poses, moving, reactions, strict=True):
        stored = (*pose, *velocities, *reaction)
        values |= {f"{body.name}.{field}": value for (field, _), value in zip(BODY_FIELDS, stored, strict=True)}
    return values


def _stored_joint_forces(context: StepContext, joints: Sequence[JointConstraint], forces: State) -> State:
    """Return the forces of joints that are stored: all of them with a warm start, else commands alone."""
    warm = context.settings.scheme.warm_start
    kept = forces if warm else {name: ca.SX.zeros(*force.shape) for name, force in forces.items()}
    return kept | commanded(context, joints, forces)


@traced
def _times(duration: Expr, lag: Expr) -> tuple[Expr, Expr]:
    """Return the time over which impulses act as forces, and the next lag [s]; equation 2."""
    return duration / 2 + lag, duration / 2


def _store_forces(
    context: StepContext,
    constraints: Sequence[PlacedConstraint],
    impulses: Sequence[ContactImpulse],
    solved: AllVelocities,
    kick: Expr,
    values: State,
    x: State,
    impacts: Struck,
) -> list[tuple[Expr, Expr]]:
    """Store persistent contact forces (without impacts) in ``values``; return their sum on each body.

    Where a limit of a body's joints is struck, its contacts keep the forces of the last substep, as joints do: what
    they give holds the impact, and would go on for the rest of the step.
    """
    scheme = context.settings.scheme
    total = [(ca.SX.zeros(3), ca.SX.zeros(3)) for _ in context.world.bodies]
    for pair, each, impulse in zip(context.world.pairs, constraints, impulses, strict=True):
        moving = tuple(solved[i] for i in each.carriers) if pair.law.soft else ()
        force, torque = _persistent(each.constraint, impulse, kick, context.shortest_kick, moving)
        struck = [impact for group, impact in impacts.items() if group & set(each.bodies)]
        if struck and not pair.law.soft:
            kept = x[f"{pair.name}.force"], x[f"{pair.name}.torque"] if pair.law.spins else ca.SX.zeros(3)
            force, torque = _unless_struck(tuple(struck), kept, (force, torque))
        values[f"{pair.name}.force"] = force if scheme.warm_start else ca.SX.zeros(3)
        if pair.law.spins:
            values[f"{pair.name}.torque"] = torque if scheme.warm_start else ca.SX.zeros(3)
        sums = _add_wrench(tuple(total[body] for body in each.bodies), each.constraint, force, torque)
        for body, summed in zip(each.bodies, sums, strict=True):
            total[body] = summed
    return total


@traced
def _unless_struck(impacts: tuple[Expr, ...], kept: Wrench, found: Wrench) -> Wrench:
    struck = ca.mmax(ca.vertcat(*impacts))
    return ca.if_else(struck, kept[0], found[0]), ca.if_else(struck, kept[1], found[1])


@traced
def _persistent(
    constraint: ContactConstraint, impulse: ContactImpulse, kick: Expr, shortest: Expr, momenta: AllVelocities
) -> tuple[Expr, Expr]:
    share = (1 - constraint.leaving) * (1 - constraint.struck) / ca.fmax(kick, shortest)
    if constraint.soft is not None:
        n = constraint.impulse_normal
        normal = constraint.soft.lasting(ca.dot(constraint.normal, constraint.slip(momenta)), impulse.normal)
        return n * normal + share * impulse.tangent, share * impulse.angular(n)
    return share * impulse.linear(constraint.impulse_normal), share * impulse.angular(constraint.impulse_normal)


def _lagging(context: StepContext, x: State, bodies: Sequence[int]) -> tuple[tuple[Expr, Expr], ...]:
    """Return the persistent impulses of ``SubstepFlags``, under which motions with joints are predicted."""
    names = () if context.world.joints else tuple(context.world.bodies[i].name for i in bodies)
    return tuple((x[f"{name}.reaction_force"], x[f"{name}.reaction_torque"]) for name in names)


def _with_late_impulses(
    constraints: Sequence[PlacedConstraint], impulses: Sequence[ContactImpulse], momenta: Momenta
) -> tuple[tuple[ContactImpulse, ...], Momenta]:
    """Add the late impulses of soft contacts that begin or end in the substep; see ``SoftImpulse.late``."""
    whole, soft = list(impulses), [k for k, each in enumerate(constraints) if each.constraint.law.soft]
    found = list(momenta)
    for k in soft:
        bodies = constraints[k].bodies
        whole[k], moved = _late(constraints[k].constraint, impulses[k], tuple(found[i] for i in bodies))
        for i, after in zip(bodies, moved, strict=True):
            found[i] = after
    return tuple(whole), tuple(found)


@traced
def _late(constraint: ContactConstraint, impulse: ContactImpulse, momenta: Momenta) -> tuple[ContactImpulse, Momenta]:
    """Return impulse and momenta with the late normal impulse; friction of surfaces that slide grows in proportion."""
    assert constraint.soft is not None
    late = ca.if_else(impulse.normal > 0, constraint.soft.late, 0)
    slides = constraint.friction.beyond(impulse.tangent, impulse.normal, SLIDING_SHARE)
    share = ca.if_else(slides, late / ca.fmax(impulse.normal, TINY_SQUARE), 0)
    more, found = replace(ZERO_IMPULSE, normal=late, tangent=share * impulse.tangent), []
    push = more.linear(constraint.impulse_normal)
    for term, m in zip(constraint.terms, momenta, strict=True):
        turned = m.angular + term.sign * ca.cross(term.impulse_arm, push)
        found.append(Momentum(m.velocity + term.sign * term.inverse_mass * push, turned))
    return impulse.plus(more), tuple(found)


@traced
def _add_wrench(
    totals: tuple[tuple[Expr, Expr], ...], constraint: ContactConstraint, force: Expr, torque: Expr
) -> tuple[tuple[Expr, Expr], ...]:
    found = []
    for total, term in zip(totals, constraint.terms, strict=True):
        turning = ca.cross(term.impulse_arm, force) + torque
        found.append((total[0] + term.sign * force, total[1] + term.sign * turning))
    return tuple(found)


@traced
def _pose(motion: PredictedMotion, shift: Displacement) -> tuple[Expr, Expr]:
    return motion.position + shift.linear, rotation.turn(motion.orientation, shift.angular)


@traced
def _tree_pose(motion: PredictedMotion, arrived: FinalPose) -> tuple[Expr, Expr]:
    return arrived.position, rotation.unit(rotation.multiply(arrived.turn, motion.orientation))


@traced
def _free_pose(
    motion: PredictedMotion, moved: TreeDisplacement, shift: Displacement, momentum: Momentum
) -> tuple[tuple[Expr, Expr], Momentum]:
    """Free rotation with the momentum after the impulses, less what these did too early, then pushes.

    A push turns the angular momentum with the body: about the axis of a slender body it would else become a spin, with
    energy from nowhere.
    """
    assert isinstance(moved, Displacement)
    late = moved.angular - motion.dt * apply(motion.inverse_mid, momentum.angular)
    pushed = rotation.exponential(shift.angular - moved.angular)
    free = turned(motion.inertia, motion.orientation, momentum.angular, motion.dt)
    q = rotation.unit(rotation.multiply(pushed, rotation.turn(free, late)))
    return (motion.position + shift.linear, q), replace(momentum, angular=rotation.rotate(pushed, momentum.angular))


@traced
def _end_momentum(motion: PredictedMotion, momentum: Momentum, reactions: tuple[Expr, Expr]) -> Momentum:
    """Return the pose at the end of the substep."""
    half, (force, torque) = motion.dt / 2, reactions
    return Momentum(
        momentum.velocity + half * (motion.acceleration + force / motion.mass),
        momentum.angular + half * (motion.torque + torque),
    )


@traced
def _velocities(motion: PredictedMotion, momentum: Momentum, pose: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
    return momentum.velocity, angular_velocity(motion.inertia, pose[1], momentum.angular)
