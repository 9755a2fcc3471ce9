"""Sensors of joints: coordinates and rates, the forces of motors, reactions, separation, relative orientation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.applied import applied_wrench
from symphys.dynamics.arguments import parts_of
from symphys.dynamics.articulated.forward_dynamics import Wrench
from symphys.dynamics.context import State, StepContext, make_context
from symphys.dynamics.joints.joint_frames import JointFrames, free, joint_frames_at
from symphys.dynamics.joints.warm_start import joint_wrenches
from symphys.dynamics.motion import PredictedMotion
from symphys.dynamics.observation.sensor_kind import MjcfSensor, SensedState, SensorKind
from symphys.dynamics.prediction import predicted_motions
from symphys.dynamics.tracing.decorator import traced, tracing
from symphys.dynamics.tracing.trace import InlineTracer
from symphys.maths import rotation
from symphys.maths.rotation import matrix, rotate
from symphys.model.joints import Coordinate, Joint, JointFrame, PlacedFrames, kinematic_trees
from symphys.model.state_layout import INPUT_FIELDS, Layout, input_sizes
from symphys.model.world import World
from symphys.records import dataclass
from symphys.types import Expr

WORLD_ORIENTATION = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the world's frame."""
Motion = tuple[Expr, Expr]
"""(3,) velocity [m/s], (3,) angular velocity [rad/s], world frame."""


@dataclass(frozen=True)
class Reading:
    """A joint in a state with k coordinates: angles [rad], which count whole turns, and displacements [m].

    Attributes:
        value, rate: (k,).
        torque: (k,) of the motor in the last substep before, [N m] or [N]; zeros without a motor.
        separation: how far the frames are apart, as far as the joint holds them together [m].
        tilt: how far they are turned against each other, as far as it holds that [rad].
    """

    value: Expr
    rate: Expr
    torque: Expr
    separation: Expr
    tilt: Expr


def readings(world: World, x: Expr) -> dict[str, Reading]:
    """Return every joint of a state x (see ``Layout``), by name."""
    layout = Layout(world)
    return {joint.name: _reading(world, layout, joint, x) for joint in world.joints}


def reading_function(world: World, parameters: Sequence[Any] = ()) -> ca.Function:
    """Return (x, p) -> value, rate, torque (coordinates of all joints,), separation (joints,).

    P stacks the parameters.
    """
    x = ca.SX.sym("x", Layout(world).size)
    found = readings(world, x).values()
    parts = zip(*((r.value, r.rate, r.torque, r.separation) for r in found), strict=True) if found else ((),) * 4
    results = [ca.densify(ca.vertcat(ca.SX(0, 1), *part)) for part in parts]
    return ca.Function("joints", [x, ca.vertcat(ca.SX(0, 1), *parameters)], results)


def _reading(world: World, layout: Layout, joint: Joint, x: Expr) -> Reading:
    names, coordinates = [world.bodies[i].name for i in joint.bodies], joint.kind.coordinates
    poses = tuple((x[layout[f"{name}.position"]], x[layout[f"{name}.orientation"]]) for name in names)
    motions = [(x[layout[f"{name}.velocity"]], x[layout[f"{name}.angular_velocity"]]) for name in names]
    frames = joint_frames_at(joint, poses)
    placed, held = frames.placed(ca.SX(0)), joint.kind.held
    rates = [_rate(frames, placed, coordinate, motions) for coordinate in coordinates]
    torque = x[layout[f"{joint.name}.motor"]] if joint.driven else ca.SX.zeros(len(coordinates))
    near = ca.SX(0, 1) if joint.unwrapped is None else x[layout[joint.unwrapped]]
    off = joint.kind.errors(placed, near)
    return Reading(
        value=ca.vertcat(ca.SX(0, 1), *(joint.value(k, placed, near) for k in range(len(coordinates)))),
        rate=ca.vertcat(ca.SX(0, 1), *rates),
        torque=torque,
        separation=ca.norm_2(off[:held]),
        tilt=ca.norm_2(off[held:]),
    )


def _rate(frames: JointFrames, placed: PlacedFrames, coordinate: Coordinate, motions: list[Motion]) -> Expr:
    """Return the rate of the first body against the second along a coordinate."""
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for sign, arm, (velocity, spin) in zip((1, -1), frames.lever_arms(ca.SX(0)), motions, strict=False):
        linear += sign * (velocity + ca.cross(spin, arm))
        angular += sign * spin
    return free(coordinate, placed).forwards(linear, angular)


def joint_readings(at: SensedState) -> dict[str, Reading]:
    """Return the readings of every joint, by name; see ``SensedState.shared``."""
    return readings(at.world, at.x)


def _reads(field: str) -> Callable[[SensedState, Joint], Expr]:
    """Return a function that reads a field of a joint's ``Reading``."""

    def read(at: SensedState, joint: Joint) -> Expr:
        return getattr(at.shared(joint_readings)[joint.name], field)

    return read


def _turns(joint: Joint) -> bool:
    return bool(joint.kind.coordinates) and joint.kind.coordinates[0].turns


def _slides(joint: Joint) -> bool:
    return bool(joint.kind.coordinates) and not joint.kind.coordinates[0].turns


def _reactions(at: SensedState) -> dict[str, Wrench]:
    """Return by joint what its second side exerts on its first through it: force, and torque about the first's point.

    World frame, under the forces that last. Joints of trees carry what the accelerations of all bodies beyond them ask
    for beside the other forces on these (Newton-Euler), other joints what the sweeps found; see docs/joints.md.
    """
    world, zero, tracer = at.world, ca.SX.zeros(3), InlineTracer(reduces=False)
    x = parts_of(at.layout, at.x)
    acted = tuple(name for name in input_sizes(world) if name in at.before)
    context = make_context(world, None, acted, ca.vertcat(ca.SX(0, 1), *(at.before[n] for n in acted)), ca.SX(0))
    for column in (*x.values(), context.u):
        tracer.take(column)
    with tracing(tracer):
        poses = [(x[f"{body.name}.position"], x[f"{body.name}.orientation"]) for body in world.bodies]
        points = {joint.name: _point(joint.frames[0], poses[joint.first]) for joint in world.joints}
        found = {joint.name: (zero, zero) for joint in world.joints}

        # what joints of trees lock: from the leaves to the root, what all bodies beyond a joint lack
        motions = predicted_motions(context, x, ca.SX(at.dt))
        for tree in kinematic_trees(world.joints):
            lacking = {
                i: _missing_wrench(motions[i], context.settings.gravity, *_known(context, x, i, ca.SX(at.dt)))
                for i in tree.bodies
            }
            for link in reversed(tree.links):
                place = poses[link.body][0]
                if link.parent is not None:
                    above = lacking[link.parent], poses[link.parent][0]
                    lacking[link.parent] = _with_wrench(*above, lacking[link.body], place)
                if link.joint is not None:
                    joint = world.joints[link.joint]
                    total = found[joint.name], points[joint.name]
                    found[joint.name] = _with_wrench(*total, _signed(lacking[link.body], link.sign), place)

        # what acts along coordinates, and the locks of other joints
        for joint, wrenches in joint_wrenches(context, x, poses):
            total = found[joint.name], points[joint.name]
            found[joint.name] = _with_wrench(*total, wrenches[0], poses[joint.first][0])
    return {name: (tracer.value(force), tracer.value(torque)) for name, (force, torque) in found.items()}


def _known(context: StepContext, x: State, index: int, duration: Expr) -> tuple[Wrench, Wrench]:
    """Return the external and the persistent forces on a body in the step before."""
    name = context.world.bodies[index].name
    given = applied_wrench(context, x, index, duration)
    return given, (x[f"{name}.reaction_force"], x[f"{name}.reaction_torque"])


@traced
def _point(frame: JointFrame, pose: tuple[Expr, Expr]) -> Expr:
    return pose[0] + rotate(pose[1], ca.vertcat(*frame.point))


@traced
def _missing_wrench(motion: PredictedMotion, gravity: Expr, given: Wrench, lasting: Wrench) -> Wrench:
    """Return the rates of a body's momenta less all forces on it but those that its tree locks.

    A frame has no momenta.
    """
    counted = 0 if motion.massless else 1
    force = counted * motion.mass * (motion.acceleration - gravity) - given[0] - lasting[0]
    return force, counted * motion.torque - given[1] - lasting[1]


@traced
def _signed(wrench: Wrench, sign: int) -> Wrench:
    return sign * wrench[0], sign * wrench[1]


@traced
def _with_wrench(total: Wrench, about: Expr, more: Wrench, place: Expr) -> Wrench:
    """Return a force, and a torque about a point, with others that are given about another place."""
    return total[0] + more[0], total[1] + more[1] + ca.cross(place - about, more[0])


def _reaction(part: int) -> Callable[[SensedState, Joint], Expr]:
    """Return a function that reads the force (0) or the torque (1) of a joint in the axes of its first side."""

    def read(at: SensedState, joint: Joint) -> Expr:
        turned = matrix(at.part(f"{at.world.bodies[joint.first].name}.orientation"))
        return ca.mtimes(turned.T, at.shared(_reactions)[joint.name][part])

    return read


def _all_inputs(world: World, joint: Joint) -> tuple[str, ...]:
    return tuple(f"{body.name}.{field}" for body in world.bodies for field in INPUT_FIELDS)


JOINT_SENSORS = (
    SensorKind(
        "angle",
        "joint",
        "the coordinate of a joint that turns, 0 in the pose of the file",
        _reads("value"),
        unit="rad",
        size=None,
        has=_turns,
        mjcf=MjcfSensor("jointpos", "joint"),
    ),
    SensorKind(
        "position",
        "joint",
        "the coordinate of a slider, 0 in the pose of the file",
        _reads("value"),
        unit="m",
        size=None,
        has=_slides,
        mjcf=MjcfSensor("jointpos", "joint"),
    ),
    SensorKind(
        "rate",
        "joint",
        "the derivative of the coordinate in time",
        _reads("rate"),
        unit="rad/s",
        sliding_unit="m/s",
        size=None,
        has=lambda joint: bool(joint.kind.coordinates),
        mjcf=MjcfSensor("jointvel", "joint"),
    ),
    SensorKind(
        "torque",
        "joint",
        "output of the motor in the last substep; for a servo, the mean up to half a substep before its end",
        _reads("torque"),
        unit="N m",
        sliding_unit="N",
        size=None,
        has=lambda joint: joint.driven,
        mjcf=MjcfSensor("jointactuatorfrc", "joint"),
    ),
    SensorKind(
        "reaction_force",
        "joint",
        "the force that the first body of `between` exerts on the second through the joint, in the second's axes",
        _reaction(0),
        unit="N",
        axes="own",
        before=_all_inputs,
        parameters=frozenset({"gravity"}),
        ahead=False,
        kept=True,
        mjcf=MjcfSensor("force", "frame"),
    ),
    SensorKind(
        "reaction_torque",
        "joint",
        "the torque about the joint's point on the second body that goes with it, in the second's axes",
        _reaction(1),
        unit="N m",
        axes="own",
        before=_all_inputs,
        parameters=frozenset({"gravity"}),
        ahead=False,
        kept=True,
        mjcf=MjcfSensor("torque", "frame"),
    ),
)
"""Every kind of sensor of a joint."""


def joint_turn(joint: Joint, orientations: tuple[Expr, ...], spins: tuple[Expr, ...]) -> tuple[Expr, Expr]:
    """Return the orientation (4,) of the joint's first frame in its second, and the angular velocity (3,) [rad/s].

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
