"""What can be read off a joint in a state: its coordinates, their rates, what its motor gives, how far it is apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.joints.joint_frames import JointFrames, free, joint_frames_at
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


def joint_quantities(world: World, x: Expr) -> dict[str, Expr]:
    """What formulas call them: ``knee.angle`` or ``rail.position``, ``.rate``, and ``.torque`` if there is a motor."""
    return named_readings(world, readings(world, x))


def named_readings(world: World, found: Mapping[str, Reading]) -> dict[str, Expr]:
    """See ``joint_quantities``, of joints that have been read; ``found``: all of them."""
    named: dict[str, Expr] = {}
    for joint, reading in zip(world.joints, found.values(), strict=True):
        parts = (reading.value, reading.rate, reading.torque)
        named.update(zip(_names(joint), parts, strict=False))
    return named


def joint_quantity_names(world: World) -> list[str]:
    """The names of ``joint_quantities``."""
    return [name for joint in world.joints for name in _names(joint)]


def _names(joint: Joint) -> list[str]:
    """In the order value, rate, torque; none without coordinates."""
    if not joint.kind.coordinates:
        return []
    return [
        f"{joint.name}.{field}"
        for field in (joint.kind.quantity, "rate", *(("torque",) if joint.motor is not None else ()))
    ]


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
    """How fast the first body moves against the second along a coordinate."""
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for sign, arm, (velocity, spin) in zip((1, -1), frames.lever_arms(ca.SX(0)), motions, strict=False):
        linear += sign * (velocity + ca.cross(spin, arm))
        angular += sign * spin
    return free(coordinate, placed).forwards(linear, angular)
