"""The scene of a problem: what a picture needs of a world whose parameters are set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from symphys.model.joints import Joint, Motor, Servo, TorqueMotor, VelocityMotor
from symphys.model.shapes import Box, Fixture, Plane, Scalar, Shape, Sphere, Terrain
from symphys.problem import Problem
from symphys.results.scene import Scene, SceneBody, SceneFixture, ScenePlane, Solid
from symphys.results.scene_joints import SceneCoordinate, SceneJoint, SceneMotor, SceneSocket
from symphys.results.terrain_crop import crop, sample
from symphys.shooting import Array
from symphys.trajectory import Trajectory

MOTORS: dict[type[Motor], str] = {Servo: "servo", VelocityMotor: "velocity", TorqueMotor: "torque"}
"""As problem files call them."""


def make_scene(problem: Problem, z: Mapping[str, Array], motion: Trajectory | None = None) -> Scene:
    """Gravity, bodies, what stands still, and joints, in SI units, with the parameters that ``z`` (by variable) sets.

    Terrain is sampled where ``motion`` goes; without one, around the bodies at the start.
    """
    world = problem.world(parameters(problem, z))
    if motion is None:
        places = np.array([problem.initial[f"{body.name}.position"] for body in world.bodies])
    else:
        places = motion.position.reshape(-1, 3)
    near = crop(world, places)
    names = [body.name for body in world.bodies]
    return Scene(
        gravity=tuple(plain(world.gravity).tolist()),
        bodies=tuple(
            SceneBody(body.name, tuple(map(make_solid, body.shapes)), float(body.mass)) for body in world.bodies
        ),
        planes=tuple(
            ScenePlane(each.name, plain(each.normal), float(each.offset))
            for each in world.statics
            if isinstance(each, Plane)
        ),
        fixtures=tuple(
            SceneFixture(each.name, make_solid(each.shape)) for each in world.statics if isinstance(each, Fixture)
        ),
        terrain=tuple(sample(each, near) for each in world.statics if isinstance(each, Terrain)),
        joints=tuple(make_joint(joint, names) for joint in world.joints),
    )


def parameters(problem: Problem, z: Mapping[str, Array]) -> dict[str, Any]:
    """The values of the physical parameters that variables set; ``z`` holds (components, knots) arrays."""
    values: dict[str, Any] = {}
    for variable in problem.variables:
        if variable.kind != "parameter":
            continue
        for slot in variable.slots:
            whole = values.get(slot.name, np.array(problem.parameters[slot.name], float))
            whole[list(slot.components)] = z[variable.name].ravel()
            values[slot.name] = whole
    return {name: float(whole[0]) if whole.size == 1 else tuple(whole.tolist()) for name, whole in values.items()}


def make_solid(shape: Shape) -> Solid:
    """A shape with numbers, no symbols."""
    if isinstance(shape, Sphere):
        return Solid(float(shape.radius), centre=plain(shape.centre))
    if isinstance(shape, Box):
        return Solid(0.0, plain(shape.half_sizes), plain(shape.centre), plain(shape.orientation))
    half = np.array([0.0, 0.0, float(shape.half_length)])
    return Solid(float(shape.radius), half, plain(shape.centre), plain(shape.orientation))


def make_joint(joint: Joint, bodies: Sequence[str]) -> SceneJoint:
    """A joint with numbers, no symbols; ``bodies``: the names of the world's bodies."""
    return SceneJoint(
        name=joint.name,
        kind=joint.kind.name,
        first=bodies[joint.first],
        second="" if joint.second is None else bodies[joint.second],
        sockets=tuple(SceneSocket(plain(socket.point), plain(socket.orientation)) for socket in joint.sockets),
        coordinates=tuple(SceneCoordinate(each.name, each.turns) for each in joint.kind.coordinates),
        lower=bound(joint.limits.lower, -np.inf),
        upper=bound(joint.limits.upper, np.inf),
        motor=None if joint.motor is None else make_motor(joint.motor),
    )


def bound(value: Scalar | None, missing: float) -> float:
    """One end of limits."""
    return missing if value is None else float(value)


def make_motor(motor: Motor) -> SceneMotor:
    """A motor with those of its bounds that there are, and a servo's gain."""
    return SceneMotor(MOTORS[type(motor)], {key: float(v) for key, v in asdict(motor).items() if v is not None})


def plain(vector: Any) -> Array:
    """A vector of numbers."""
    return np.array([float(component) for component in vector])
