"""Predicted motion of bodies within a substep before its impulses, and contacts along their paths."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from typing import TypeVar

import casadi as ca

from symphys.dynamics.applied import applied_wrench
from symphys.dynamics.arguments import surface_as_arguments
from symphys.dynamics.collision import Contact, collide
from symphys.dynamics.collision.predicted_path import PredictedPath, at_rest
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.motion import BodyState, PredictedMotion, free_motion, momentum, motion_from
from symphys.dynamics.tracing.decorator import traced
from symphys.model.joints import kinematic_trees
from symphys.model.shapes import Surface
from symphys.model.state_layout import BODY_FIELDS
from symphys.model.world import Pair, World
from symphys.types import Expr

T = TypeVar("T")


def detect_contacts(context: StepContext, motions: Sequence[PredictedMotion], duration: Expr) -> list[Contact]:
    """Return the contacts on the way: one for each pair."""
    return along_paths(collide, context, motions, duration)


def along_paths(
    look: Callable[[Surface, Surface, PredictedPath, PredictedPath], list[T]],
    context: StepContext,
    motions: Sequence[PredictedMotion],
    duration: Expr,
) -> list[T]:
    """Apply ``look`` to the two surfaces of each pair, on their bodies' paths."""
    found: list[T] = []
    for (first, second), _ in groupby(context.world.pairs, key=lambda pair: (pair.first, pair.second)):
        one, other = (surface_as_arguments(context.world.surface(side)) for side in (first, second))
        a = motions[_index(first.body)].predicted_path()
        b = at_rest(duration) if second.body is None else motions[second.body].predicted_path()
        found += look(one, other, a, b)
    return found


def jointed_bodies(world: World) -> set[int]:
    """Return the indices of the bodies that joints hold."""
    return {index for joint in world.joints for index in joint.bodies}


def bodies_of(pair: Pair) -> tuple[int, ...]:
    """Return the indices of the bodies on the sides that can move."""
    return tuple(side.body for side in (pair.first, pair.second) if side.body is not None)


def free_motions(context: StepContext, x: State, duration: Expr) -> list[PredictedMotion]:
    """Return each body's free motion; the stored velocities are freed from the last half step's persistent forces."""
    return _motions(context, x, duration, -1, 0)


def predicted_motions(context: StepContext, x: State, duration: Expr) -> list[PredictedMotion]:
    """Return each body's motion from its true velocity under the last persistent forces, as joints let it."""
    from symphys.dynamics.articulated.forward_dynamics import accelerations, world_inertia

    found, joints = _motions(context, x, duration, 0, 1), context.world.joints
    gravity = context.settings.gravity
    for tree in kinematic_trees(joints):
        own = tuple(None if link.joint is None else joints[link.joint] for link in tree.links)
        motions = tuple(found[i] for i in tree.bodies)
        wrenches = tuple(_wrench(motion) for motion in motions)
        for i, change in zip(tree.bodies, accelerations(tree, own, motions, wrenches), strict=True):
            motion, weight = found[i], ca.SX.zeros(3) if found[i].massless else gravity
            tensor = world_inertia(motion.inertia, motion.rotation)
            found[i] = replace(_as_held(motion, tensor, change, weight), massless=motion.massless)
    return found


@traced
def _wrench(motion: PredictedMotion) -> tuple[Expr, Expr]:
    return motion.mass * motion.acceleration, motion.torque


@traced
def _as_held(motion: PredictedMotion, tensor: Expr, change: tuple[Expr, Expr], gravity: Expr) -> PredictedMotion:
    """Return the motion with the accelerations that joints leave."""
    w = motion.angular_velocity
    torque = ca.mtimes(tensor, change[1]) + ca.cross(w, ca.mtimes(tensor, w))
    force = motion.mass * (change[0] - gravity)
    state = BodyState(motion.position, motion.orientation, motion.velocity, motion.momentum_k, force, torque)
    return motion_from(motion.mass, motion.inertia, state, (motion.rotation, w), gravity, motion.dt)


def _motions(context: StepContext, x: State, duration: Expr, freed: int, share: int) -> list[PredictedMotion]:
    """Return motions with ``freed`` lags of the persistent forces in the velocities and ``share`` of them acting."""
    zero, lag = ca.SX.zeros(3), x["lag"]
    motions, jointed = [], jointed_bodies(context.world)
    for index, body in enumerate(context.world.bodies):
        part = {name: x[f"{body.name}.{name}"] for name, _ in BODY_FIELDS}
        push = applied_wrench(context, x, index, duration)
        massless, times = body.massless, (freed, lag, share, duration)
        inertial = (ca.SX(1), ca.SX(1)) if massless else (body.mass, body.inertia)
        gravity = zero if massless else context.settings.gravity
        motion = _motion(inertial, part, push, gravity, times, index in jointed)
        motions.append(replace(motion, massless=True) if massless else motion)
    return motions


@traced
def _motion(
    inertial: tuple[Expr, Expr],
    part: dict[str, Expr],
    push: tuple[Expr, ...],
    gravity: Expr,
    times: tuple[int, Expr, int, Expr],
    jointed: bool,
) -> PredictedMotion:
    (mass, inertia), (freed, lag, share, duration) = inertial, times
    turning = momentum(inertia, part["orientation"], part["angular_velocity"])
    kick = freed * lag
    state = BodyState(
        position=part["position"],
        orientation=part["orientation"],
        velocity=part["velocity"] + kick * part["reaction_force"] / mass,
        angular_momentum=turning + kick * part["reaction_torque"],
        force=push[0] + share * part["reaction_force"],
        torque=push[1] + share * part["reaction_torque"],
    )
    found = free_motion(mass, inertia, state, gravity, duration, jointed)
    return replace(found, true_velocity=part["velocity"])


def _index(body: int | None) -> int:
    if body is None:
        raise ValueError("the first side of a pair must belong to a body")
    return body
