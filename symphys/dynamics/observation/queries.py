"""Functions of a state that take no step: gaps, slip speeds, and the state half a time step ahead."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.arguments import arguments_of, context_of, inline, parts_of
from symphys.dynamics.collision import Contact, collide
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.contact.body_term import Motions, at_touch
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.joints.joint_constraints import commanded_torque
from symphys.dynamics.joints.warm_start import on_bodies
from symphys.dynamics.motion import PredictedMotion
from symphys.dynamics.prediction import along_paths, bodies_of, detect_contacts, free_motions, predicted_motions
from symphys.dynamics.tracing.decorator import traced, tracing
from symphys.maths import rotation
from symphys.model.joints.motor import AffineMotor, TorqueMotor, given_torque
from symphys.model.shapes import Surface
from symphys.model.state_layout import Layout
from symphys.model.world import Scheme, World
from symphys.types import Expr

STATE_FIELDS = ("position", "orientation", "velocity", "angular_velocity")


def gap_function(world: World, parameters: Sequence[Any] | None = None) -> ca.Function:
    """Return the gaps [m] of a state: x -> (pairs,); candidates that cannot touch as things lie have a large one.

    With SX ``parameters`` of the world, also none, it is a function of (x, p).
    """
    arguments = arguments_of(world, (), parameters or ())
    tracer = inline(world, arguments, reduces=False)
    with tracing(tracer):
        context = context_of(world, None, (), arguments)
        duration = ca.SX(context.settings.scheme.dt)
        motions = free_motions(context, parts_of(Layout(world), arguments[0]), duration)  # a gap is of positions alone
        gaps = map(tracer.value, along_paths(_gaps, context, motions, duration))
    taken = [arguments[0]] if parameters is None else [arguments[0], arguments[2]]
    return ca.Function("gaps", taken, [ca.densify(ca.vertcat(ca.SX(0, 1), *gaps))])


def slip_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """Return the slip speeds of surfaces [m/s]: (x, u, p) -> (pairs,)."""
    x, u, p, _ = arguments = arguments_of(world, inputs, parameters)
    tracer = inline(world, arguments, reduces=False)
    with tracing(tracer):
        context = context_of(world, scheme, inputs, [x, u, p, ca.SX(0)])
        motions, duration = _motions(world, context, x)
        contacts = detect_contacts(context, motions, duration)
        moving = (tuple(motions[i] for i in bodies_of(pair)) for pair in world.pairs)
        speeds = [_slip(contact, each) for contact, each in zip(contacts, moving, strict=True)]
    values = map(tracer.value, speeds)
    return ca.Function("slip", [x, u, p], [ca.densify(ca.vertcat(ca.SX(0, 1), *values))])


@traced
def _slip(contact: Contact, motions: Motions) -> Expr:
    velocity, _, normal = at_touch(contact, motions, ca.SX(0))
    return ca.norm_2(velocity - normal * ca.dot(normal, velocity))


@traced
def _gaps(first: Surface, second: Surface, a: PredictedPath, b: PredictedPath) -> list[Expr]:
    """Return the gaps alone: the function is small, however large the code for the instant of touch."""
    return [contact.gap for contact in collide(first, second, a, b)]


def _motions(world: World, context: StepContext, x: Expr) -> tuple[list[PredictedMotion], Expr]:
    duration = ca.SX(context.settings.scheme.dt)
    return predicted_motions(context, parts_of(Layout(world), x), duration), duration


def half_step_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """Return the state at t_k + dt/2, to first order in dt: (x, u, p) -> (nx,).

    Places drift with the velocities at t_k: a force of these places alone makes the step position Verlet (drift, kick,
    drift), which is symplectic. Velocities change with the accelerations under gravity, the inputs and the persistent
    forces of the last step, as joints let them; commands of torques act at once. Everything else is as at t_k.
    """
    arguments = arguments_of(world, inputs, parameters)
    tracer, layout = inline(world, arguments, reduces=False), Layout(world)
    with tracing(tracer):
        context = context_of(world, scheme, inputs, arguments)
        x, dt = parts_of(layout, arguments[0]), ca.SX(context.settings.scheme.dt)
        values = dict(x)
        for body, motion in zip(
            world.bodies, predicted_motions(context, _with_commanded_torques(context, x), dt), strict=True
        ):
            place = _half_step_pose(
                motion.position, motion.orientation, motion.velocity, motion.angular_velocity, dt / 2
            )
            changes = (motion.acceleration, motion.angular_acceleration)
            moving = _half_step_velocity(motion.velocity, motion.angular_velocity, *changes, dt / 2)
            for name, value in zip(STATE_FIELDS, (*place, *moving), strict=True):
                values[f"{body.name}.{name}"] = value
    packed = layout.pack({name: tracer.value(part) for name, part in values.items()})
    return ca.Function("half_step", arguments[:3], [ca.densify(packed)], ["x", "u", "p"], ["x_half"])


def _with_commanded_torques(context: StepContext, x: State) -> State:
    """Return the state with the torques that are commanded in this step in place of those of the last one."""
    values, bodies = dict(x), context.world.bodies
    for joint in context.world.joints:
        given = context.input(f"{joint.name}.command")
        if given is None or not isinstance(joint.motor, TorqueMotor | AffineMotor) or not given_torque(joint.motor):
            continue
        names = [bodies[i].name for i in joint.bodies]
        poses = tuple((x[f"{name}.position"], x[f"{name}.orientation"]) for name in names)
        change = commanded_torque(joint.motor, given) - x[f"{joint.name}.{joint.drive}"]
        for name, wrench in zip(names, on_bodies(joint, poses, (("motor", change),)), strict=True):
            for part, more in zip(("reaction_force", "reaction_torque"), wrench, strict=True):
                values[f"{name}.{part}"] = values[f"{name}.{part}"] + more
    return values


@traced
def _half_step_pose(position: Expr, orientation: Expr, velocity: Expr, spin: Expr, half: Expr) -> tuple[Expr, Expr]:
    return position + half * velocity, rotation.turn(orientation, half * spin)


@traced
def _half_step_velocity(velocity: Expr, spin: Expr, change: Expr, turning: Expr, half: Expr) -> tuple[Expr, Expr]:
    return velocity + half * change, spin + half * turning
