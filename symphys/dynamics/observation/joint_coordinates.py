"""Sensors of joints: their coordinates and rates, and what their motors give; also how far joints are apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.joints.joint_frames import JointFrames, errors, free, joint_frames_at
from symphys.dynamics.observation.sensor_kind import MjcfSensor, SensedState, SensorKind
from symphys.model.joints import Coordinate, Joint, PlacedFrames
from symphys.model.state_layout import Layout
from symphys.model.world import World
from symphys.types import Expr

Motion = tuple[Expr, Expr]
"""(3,) velocity [m/s], (3,) angular velocity [rad/s], world frame."""


@dataclass(frozen=True)
class Reading:
    """A joint in a state with k coordinates: angles [rad], which count whole turns, and displacements [m].

    Attributes:
        value, rate: (k,).
        torque: (k,) of the motor in the step before, [N m] or [N]; zeros without a motor.
        separation: how far the frames are apart, as far as the joint holds them together [m].
        tilt: how far they are turned against each other, as far as it holds that [rad].
    """

    value: Expr
    rate: Expr
    torque: Expr
    separation: Expr
    tilt: Expr


def readings(world: World, x: Expr) -> dict[str, Reading]:
    """Every joint of a state x (see ``Layout``), by name."""
    layout = Layout(world)
    return {joint.name: _reading(world, layout, joint, x) for joint in world.joints}


def reading_function(world: World, parameters: Sequence[Any] = ()) -> ca.Function:
    """(x, p) -> value, rate, torque (coordinates of all joints,), separation (joints,); p stacks the SX parameters."""
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
    placed, held = frames.placed(ca.SX(0)), 3 if joint.kind.slides is None else len(joint.kind.slides)
    off = errors(joint, placed)
    rates = [_rate(frames, placed, coordinate, motions) for coordinate in coordinates]
    torque = x[layout[f"{joint.name}.motor"]] if joint.driven else ca.SX.zeros(len(coordinates))
    near = ca.SX(0, 1) if joint.unwrapped is None else x[layout[joint.unwrapped]]
    return Reading(
        value=ca.vertcat(ca.SX(0, 1), *(joint.value(k, placed, near) for k in range(len(coordinates)))),
        rate=ca.vertcat(ca.SX(0, 1), *rates),
        torque=torque,
        separation=ca.norm_2(off[:held]),
        tilt=ca.norm_2(off[held:]),
    )


def _rate(frames: JointFrames, placed: PlacedFrames, coordinate: Coordinate, motions: list[Motion]) -> Expr:
    """How fast the first body moves against the second along a coordinate."""
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for sign, arm, (velocity, spin) in zip((1, -1), frames.lever_arms(ca.SX(0)), motions, strict=False):
        linear += sign * (velocity + ca.cross(spin, arm))
        angular += sign * spin
    return free(coordinate, placed).forwards(linear, angular)


def _readings(at: SensedState) -> dict[str, Reading]:
    return readings(at.world, at.x)


def _reads(field: str) -> Callable[[SensedState, Joint], Expr]:
    """Return a function that reads a field of a joint's ``Reading``."""

    def read(at: SensedState, joint: Joint) -> Expr:
        return getattr(at.shared(_readings)[joint.name], field)

    return read


def _turns(joint: Joint) -> bool:
    return bool(joint.kind.coordinates) and joint.kind.coordinates[0].turns


def _slides(joint: Joint) -> bool:
    return bool(joint.kind.coordinates) and not joint.kind.coordinates[0].turns


JOINT_SENSORS = (
    SensorKind(
        "angle",
        "joint",
        "the coordinate of a joint that turns, 0 as the bodies lie in the file",
        _reads("value"),
        unit="rad",
        size=None,
        has=_turns,
        mjcf=MjcfSensor("jointpos", "joint"),
    ),
    SensorKind(
        "position",
        "joint",
        "the coordinate of a slider, 0 as the bodies lie in the file",
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
        "what the motor gave in the last step; of a servo its mean over a step until half a step ago",
        _reads("torque"),
        unit="N m",
        sliding_unit="N",
        size=None,
        has=lambda joint: joint.driven,
        mjcf=MjcfSensor("jointactuatorfrc", "joint"),
    ),
)
"""Every kind of sensor of a joint."""
