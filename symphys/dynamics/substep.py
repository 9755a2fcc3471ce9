"""A stretch of time within a step: free motion, rows, sweeps, positions, and what is stored at its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.forward_kinematics import Arrived
from symphys.dynamics.collision import Contact
from symphys.dynamics.collision.contact_geometry import Shift
from symphys.dynamics.contact.constraint import ContactRow
from symphys.dynamics.contact.load_distribution import shared
from symphys.dynamics.contact.local_solver import may_couple
from symphys.dynamics.contact.preparation import Conditions, prepare
from symphys.dynamics.contact.projection import ZERO, Impulse
from symphys.dynamics.context import Scene, State
from symphys.dynamics.free_rotation import turned
from symphys.dynamics.joints.assembly import JointRow, Trees, joint_rows, make_trees, momenta_of, resumed
from symphys.dynamics.joints.loop_closure import Displaced
from symphys.dynamics.joints.warm_start import fitting, hold, keep_up, kept
from symphys.dynamics.momentum import Momenta, Momentum
from symphys.dynamics.motion import Motion, angular_velocity, apply, isotropic
from symphys.dynamics.pgs import Row, Solution, begin, relax
from symphys.dynamics.position_correction import Closed, close_gaps, displacements
from symphys.dynamics.prediction import bodies_of, expected_motions, free_motions, jointed_bodies, look
from symphys.dynamics.tracing.decorator import traced
from symphys.maths import rotation
from symphys.model.state_layout import BODY_FIELDS

Expr = Any
"""casadi SX, MX or DM"""


NONE = ca.SX(0)


@dataclass(frozen=True)
class Phase:
    """A stretch that has been advanced.

    Attributes:
        x: the state at its end.
        rows, contacts: of the pairs.
        impulses: what each has given.
        changes: of every row, joints too, what it has given and what it had before the final sweep.
        ahead: (3,) each [N s]: what persistent forces had given to the true velocities ahead of the impulses of
            sweeps. The next stretch takes it off again, but after an impact, where leapfrog begins anew, it stays.
        chained: 1 if impacts were left to the next step.
    """

    x: State
    rows: tuple[Row, ...]
    contacts: tuple[Contact, ...]
    impulses: tuple[Impulse, ...]
    changes: tuple[tuple[Any, Any], ...]
    ahead: tuple[Expr, ...] = ()
    chained: Expr = NONE


def advance(scene: Scene, x: State, duration: Expr, spared: Sequence[Expr] = (), plastic: Expr = NONE) -> Phase:
    """The state after ``duration`` [s].

    Pairs whose ``spared`` is 1 give no impulse, since the stretch ends as they meet. Where ``plastic`` is 1 nothing
    rebounds.
    """
    kick, half = _times(duration, x["lag"])

    # free motion, in which impacts find their instant; what joints hold moves as the last step's forces say
    motions = free_motions(scene, x, duration)
    paths = expected_motions(scene, x, duration) if scene.world.joints else motions
    contacts = look(scene, paths, duration)

    # trees of joints, whose velocities are solved for in the coordinates that joints leave
    free = tuple(_mid_momentum(motion) for motion in motions)
    trees = make_trees(scene, paths, free, half)

    # rows: where, when and how the surfaces meet, what acts along the coordinates of joints
    rows = _contact_rows(scene, x, trees, contacts, duration, spared or [ca.SX(0)] * len(contacts), plastic)
    joints, fitted = joint_rows(scene, trees, paths, duration, kick)

    # velocities: warm start, then sweeps
    given = shared(scene, rows, _warm_start(scene, rows, x, kick))
    solved, by_joints, impulses = _sweep(scene, trees, joints, rows, (*resumed(scene, joints, x, kick), *given))
    momenta = momenta_of(scene, trees, solved.momenta)

    # positions
    moved = displacements(scene, trees, rows, given, solved.momenta, impulses, duration)
    closed = close_gaps(scene, trees, list(zip(rows, contacts, impulses, strict=True)), fitted, moved)

    # the next state
    values: State = {"lag": half}
    resting = _store_forces(scene, rows, impulses, kick, values)
    poses, momenta = _poses(scene, motions, moved, closed, momenta)
    if scene.world.joints:
        struck, forces = kept(scene, rows, joints, by_joints, x, kick)
        hold(scene, forces, poses, resting)
        momenta = keep_up(scene, momenta, closed.made, struck, duration)
        warm = scene.setting.scheme.warm_start
        values |= forces if warm else {name: ca.SX.zeros(force.shape) for name, force in forces.items()}
    values |= _moving_bodies(scene, motions, momenta, resting, poses)
    return Phase(values, tuple(rows), tuple(contacts), impulses, tuple(zip(solved.impulses, solved.last, strict=True)))


def _contact_rows(
    scene: Scene,
    x: State,
    trees: Trees,
    contacts: Sequence[Contact],
    duration: Expr,
    spared: Sequence[Expr],
    plastic: Expr,
) -> list[Row]:
    rows = []
    for pair, contact, off in zip(scene.world.pairs, contacts, spared, strict=True):
        bodies, force = bodies_of(pair), x[f"{pair.name}.force"]
        conditions = Conditions(off, plastic, force, trees.same(bodies), may_couple(scene.world, pair))
        arguments = pair.law, contact, tuple(trees.motions[i] for i in bodies), duration, conditions
        rows.append(trees.row(bodies, prepare(scene.setting, *arguments)))
    return rows


def _sweep(
    scene: Scene, trees: Trees, joints: Sequence[JointRow], rows: Sequence[Row], start: Sequence[Any]
) -> tuple[Solution, tuple[Any, ...], tuple[Impulse, ...]]:
    """What sweeps come to from these impulses; and of it the impulses of joints, and those of contacts."""
    every = (*(each.row for each in joints), *rows)
    state = begin(every, trees.states, start)
    solved = relax(scene.world, scene.setting.scheme.sweeps, every, state, trees.motions)
    return solved, solved.impulses[: len(joints)], solved.impulses[len(joints) :]


def _poses(
    scene: Scene, motions: Sequence[Motion], moved: Sequence[Displaced], closed: Closed, momenta: Momenta
) -> tuple[list[tuple[Expr, Expr]], Momenta]:
    """(position, orientation) of all bodies at the end of the stretch, and momenta that turn with pushes."""
    poses, turned = list[tuple[Expr, Expr]](), list(momenta)
    jointed = jointed_bodies(scene.world)
    for k, motion in enumerate(motions):
        if k in closed.arrived:
            poses.append(_arrived(motion, closed.arrived[k]))
            continue
        shift = closed.shifts[k]
        if k in jointed or isotropic(scene.world.bodies[k].inertia):
            poses.append(_pose(motion, shift))
        else:
            pose, turned[k] = _free_pose(motion, moved[k], shift, momenta[k])
            poses.append(pose)
    return poses, tuple(turned)


def _moving_bodies(
    scene: Scene,
    motions: Sequence[Motion],
    momenta: Momenta,
    resting: Sequence[tuple[Expr, Expr]],
    poses: Sequence[tuple[Expr, Expr]],
) -> State:
    """The fields of all bodies at the end of the stretch."""
    values = State()
    ended = [_end_momentum(*parts) for parts in zip(motions, momenta, resting, strict=True)]
    apart = [_velocities(*parts) for parts in zip(motions, ended, poses, strict=True)]
    moving = fitting(scene, ended, poses, apart)
    for body, pose, velocities, reaction in zip(scene.world.bodies, poses, moving, resting, strict=True):
        stored = (*pose, *velocities, *reaction)
        values |= {f"{body.name}.{field}": value for (field, _), value in zip(BODY_FIELDS, stored, strict=True)}
    return values


@traced
def _mid_momentum(motion: Motion) -> Momentum:
    return Momentum(motion.mid_velocity, motion.mid_momentum)


@traced
def _times(duration: Expr, lag: Expr) -> tuple[Expr, Expr]:
    """(over which impulses act as forces, how far the stored velocities will be ahead of the sweeps')."""
    return duration / 2 + lag, duration / 2


def _warm_start(scene: Scene, rows: Sequence[Row], x: State, kick: Expr) -> list[Impulse]:
    """The last step's persistent forces, over this step's kick, in this step's frames."""
    if not scene.setting.scheme.warm_start:
        return [ZERO for _ in rows]
    impulses = []
    for pair, each in zip(scene.world.pairs, rows, strict=True):
        force = x[f"{pair.name}.force"]
        torque = x[f"{pair.name}.torque"] if pair.law.spins else None
        impulses.append(_resumed(each.row.impulse_normal, kick, force, torque))
    return impulses


@traced
def _resumed(n: Expr, kick: Expr, force: Expr, torque: Expr | None) -> Impulse:
    normal, tangent = _split(kick * force, n)
    if torque is None:
        return Impulse(ca.fmax(normal, 0), tangent, ZERO.spin, ZERO.roll)
    return Impulse(ca.fmax(normal, 0), tangent, *_split(kick * torque, n))


def _split(impulse: Expr, n: Expr) -> tuple[Expr, Expr]:
    """What points along n, and the rest."""
    along = ca.dot(n, impulse)
    return along, impulse - n * along


def _store_forces(
    scene: Scene, rows: Sequence[Row], impulses: Sequence[Impulse], kick: Expr, values: State
) -> list[tuple[Expr, Expr]]:
    """Persistent contact forces (impacts left out) into ``values``; returns their sum on each body."""
    scheme = scene.setting.scheme
    total = [(ca.SX.zeros(3), ca.SX.zeros(3)) for _ in scene.world.bodies]
    for pair, each, impulse in zip(scene.world.pairs, rows, impulses, strict=True):
        force, torque = _persistent(each.row, impulse, kick, scene.shortest_kick)
        values[f"{pair.name}.force"] = force if scheme.warm_start else ca.SX.zeros(3)
        if pair.law.spins:
            values[f"{pair.name}.torque"] = torque if scheme.warm_start else ca.SX.zeros(3)
        for k, body in enumerate(each.bodies):
            total[body] = _summed(total[body], each.row, k, force, torque)
    return total


@traced
def _persistent(row: ContactRow, impulse: Impulse, kick: Expr, shortest: float) -> tuple[Expr, Expr]:
    share = (1 - row.leaving) * (1 - row.struck) / ca.fmax(kick, shortest)
    return share * impulse.linear(row.impulse_normal), share * impulse.angular(row.impulse_normal)


@traced
def _summed(total: tuple[Expr, Expr], row: ContactRow, k: int, force: Expr, torque: Expr) -> tuple[Expr, Expr]:
    side = row.sides[k]
    turning = ca.cross(side.impulse_arm, force) + torque
    return total[0] + side.sign * force, total[1] + side.sign * turning


@traced
def _pose(motion: Motion, shift: Shift) -> tuple[Expr, Expr]:
    return motion.position + shift.linear, rotation.turn(motion.orientation, shift.angular)


@traced
def _arrived(motion: Motion, arrived: Arrived) -> tuple[Expr, Expr]:
    return arrived.position, rotation.unit(rotation.multiply(arrived.turn, motion.orientation))


@traced
def _free_pose(
    motion: Motion, moved: Displaced, shift: Shift, momentum: Momentum
) -> tuple[tuple[Expr, Expr], Momentum]:
    """Free rotation with the momentum after the impulses, less what these did too early, then pushes.

    A push turns the angular momentum with the body: about the axis of a slender body it would else become a spin, with
    energy from nowhere.
    """
    assert isinstance(moved, Shift)
    late = moved.angular - motion.dt * apply(motion.inverse_mid, momentum.angular)
    pushed = rotation.exponential(shift.angular - moved.angular)
    free = turned(motion.inertia, motion.orientation, momentum.angular, motion.dt)
    q = rotation.unit(rotation.multiply(pushed, rotation.turn(free, late)))
    return (motion.position + shift.linear, q), replace(momentum, angular=rotation.rotate(pushed, momentum.angular))


@traced
def _end_momentum(motion: Motion, momentum: Momentum, resting: tuple[Expr, Expr]) -> Momentum:
    """At the end of the stretch."""
    half, (force, torque) = motion.dt / 2, resting
    return Momentum(
        momentum.velocity + half * (motion.acceleration + force / motion.mass),
        momentum.angular + half * (motion.torque + torque),
    )


@traced
def _velocities(motion: Motion, momentum: Momentum, pose: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
    return momentum.velocity, angular_velocity(motion.inertia, pose[1], momentum.angular)
