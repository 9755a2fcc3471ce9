"""The scene of a problem: the part of a world with given parameters that pictures need."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import casadi as ca
import numpy as np

from symphys.errors import SymphysError
from symphys.model.body import Body
from symphys.model.joints import AffineMotor, Joint, Motor
from symphys.model.joints.motor import motor_kind
from symphys.model.shapes import Fixture, Plane, Scalar, Shape, Terrain
from symphys.model.world import World
from symphys.problem import Constraint, Problem, Target
from symphys.problem.world_tables import floats
from symphys.records import dataclass
from symphys.results.scene import (
    Scene,
    SceneBody,
    SceneContact,
    SceneFixture,
    SceneMark,
    ScenePlane,
    SceneTerrain,
    Solid,
)
from symphys.results.scene_joints import SceneCoordinate, SceneJoint, SceneJointFrame, SceneMotor
from symphys.trajectory import Trajectory
from symphys.types import Array


def make_scene(problem: Problem, z: Mapping[str, Array], motion: Trajectory | None = None) -> Scene:
    """Return gravity, bodies, static surfaces and joints, in SI units, with the parameters of ``z`` (by variable).

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
        contacts=make_contacts(world),
        marks=(*(mark for mark in map(make_mark, problem.targets) if mark is not None), *limits(problem)),
    )


def make_contacts(world: World) -> tuple[SceneContact, ...]:
    """Return the surfaces that may touch, each two once."""
    found = dict[str, SceneContact]()
    for pair in world.pairs:
        name, body = pair.name.partition(":")[0], world.bodies[pair.first.body or 0]
        other = world.statics[pair.second.shape] if pair.second.body is None else world.bodies[pair.second.body]
        friction = pair.law.friction
        known = [each for each in (friction if isinstance(friction, tuple) else (friction,)) if is_number(each)]
        most = max(map(float, known), default=math.nan)
        found.setdefault(name, SceneContact(name, body.name, pair.first.shape, other.name, most))
    return tuple(found.values())


def is_number(value: Any) -> bool:
    """Whether a number of the world is known: no phase changes it."""
    return isinstance(value, int | float) or ca.SX(value).is_constant()


def make_mark(target: Target) -> SceneMark | None:
    """Return the place that a target asks for; None if it asks for more than coordinates of one body or site."""
    found = coordinates(target)
    if found is None:
        return None
    at = np.full(3, np.nan)
    for axis, slope, rest in found:
        at[axis] = -rest / slope
    return SceneMark(target.name, at, float(target.tolerance))


def limits(problem: Problem) -> list[SceneMark]:
    """Return the planes that constraints keep coordinates of a body or a site from."""
    marks = []
    for each in problem.constraints:
        for k, (axis, slope, rest) in enumerate(coordinates(each) or ()):
            for end in (each.lower, each.upper):
                bound = float(np.ravel(end)[min(k, np.size(end) - 1)])
                if math.isfinite(bound):
                    at = np.full(3, np.nan)
                    at[axis] = (bound - rest) / slope
                    marks.append(SceneMark(each.name, at, limit=True))
    return marks


def coordinates(table: Target | Constraint) -> list[tuple[int, float, float]] | None:
    """Return (axis, slope, rest) of each component of a formula: a coordinate of one place, times slope, plus rest.

    None where a component is something else.
    """
    formula = table.formula
    names = list(formula.needed)
    if len(names) != 1 or not names[0].endswith(".position") or formula.parts:
        return None
    place = ca.SX.sym("place", 3)
    try:
        value = formula.evaluate({names[0]: place})
    except SymphysError:
        return None  # the position of a slider is a number
    slopes = ca.jacobian(value, place)
    if not slopes.is_constant():
        return None
    matrix, offset = np.array(ca.DM(slopes)), np.array(ca.DM(ca.substitute(value, place, ca.DM.zeros(3)))).ravel()
    if not (np.count_nonzero(matrix, axis=1) == 1).all():
        return None
    axes = [int(np.flatnonzero(row)[0]) for row in matrix]
    return [(axis, float(row[axis]), float(rest)) for axis, row, rest in zip(axes, matrix, offset, strict=True)]


def parameters(problem: Problem, z: Mapping[str, Array]) -> dict[str, Any]:
    """Return the physical parameters that variables set; ``z`` holds (components, knots) arrays."""
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
    """Return a shape with numbers, without symbols."""
    sizes = {key: np.array(floats(size), float)[()] for key, size in shape.sizes.items()}
    return Solid.of(shape.kind, sizes, plain(shape.centre), plain(shape.orientation))


def make_joint(joint: Joint, bodies: Sequence[str]) -> SceneJoint:
    """Return a joint with numbers, without symbols; ``bodies``: the names of the world's bodies."""
    return SceneJoint(
        name=joint.name,
        kind=joint.kind.name,
        first=bodies[joint.first],
        second="" if joint.second is None else bodies[joint.second],
        frames=tuple(SceneJointFrame(plain(frame.point), plain(frame.orientation)) for frame in joint.frames),
        coordinates=tuple(
            SceneCoordinate(each.name, each.turns, 0 if each.fixed_in_first else 1, each.axis)
            for each in joint.kind.coordinates
        ),
        lower=bound(joint.limits.lower, -np.inf),
        upper=bound(joint.limits.upper, np.inf),
        motor=None if joint.motor is None else make_motor(joint.motor),
    )


def bound(value: Scalar | None, missing: float) -> float:
    """Return one end of limits."""
    return missing if value is None else float(value)


def make_motor(motor: Motor) -> SceneMotor:
    """Return a motor with its known bounds, and a servo's gain."""
    numbers = {key: float(v) for key, v in asdict(motor).items() if v is not None and not isinstance(v, tuple)}
    if isinstance(motor, AffineMotor) and math.isfinite(motor.torque):
        numbers["torque"] = motor.torque
    return SceneMotor(motor_kind(motor), numbers)


def plain(vector: Any) -> Array:
    """Return a vector of numbers."""
    return np.array([float(component) for component in vector])


MAX_HEIGHTS = 49
"""Largest number of heights along the longer side."""
MIN_ASPECT = 0.3
"""Least ratio of the shorter side to the longer one."""
CROP_MARGIN = 0.15
"""Margin on each side, as a share of the longer one."""


@dataclass(frozen=True)
class TerrainCrop:
    """A rectangle of the x-y plane: ``low`` and ``high`` (2,) [m]."""

    low: Array
    high: Array


def crop(world: World, places: Array) -> TerrainCrop:
    """Return the rectangle where bodies at (n, 3) places may touch the ground, with room around."""
    flat = places[np.isfinite(places).all(axis=1), :2]
    flat = flat if len(flat) else np.zeros((1, 2))
    low, high = flat.min(axis=0), flat.max(axis=0)
    reach = max(size(body) for body in world.bodies)
    side = float((high - low).max()) + 2 * reach
    side = side if side > 0 else 1.0
    room = np.maximum(high - low + 2 * reach, MIN_ASPECT * side) / 2 + CROP_MARGIN * side
    middle = (low + high) / 2
    return TerrainCrop(middle - room, middle + room)


def size(body: Body) -> float:
    """Return the distance [m] from a body's centre of mass to the farthest point of its surface, at most."""
    return max((float(np.linalg.norm(shape.centre)) + shape.extent for shape in body.shapes), default=0.0)


def sample(terrain: Terrain, near: TerrainCrop) -> SceneTerrain:
    """Return heights of the terrain within a rectangle."""
    sides = near.high - near.low
    columns, rows = (int(count) for count in np.maximum(np.round(MAX_HEIGHTS * sides / sides.max()), 2))
    x, y = (np.linspace(near.low[k], near.high[k], count) for k, count in enumerate((columns, rows)))
    a, b = ca.SX.sym("x"), ca.SX.sym("y")
    height = ca.Function("height", [a, b], [terrain.height(a, b)])
    found = height(np.tile(x, rows)[None, :], np.repeat(y, columns)[None, :])
    z = np.array(found, float).reshape(rows, columns)
    return SceneTerrain(terrain.name, short(x), short(y), np.array([short(row) for row in z]))


def short(numbers: Array) -> Array:
    """Round numbers to the digits that a picture can show."""
    return np.array([float(f"{number:.7g}") for number in numbers.tolist()])
