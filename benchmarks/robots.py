"""Jointed robots for both engines: a quadruped and a chain, and their states from coordinates and rates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from symphys.model.joints import HINGE, Joint, JointFrame, Link, Motor, Servo, Spring, kinematic_trees
from symphys.model.shapes import Plane, Sphere
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, World, make_world
from symphys.types import Array

Values = dict[str, Any]
HALF = float(np.sqrt(0.5))
AXES = {"x": (1.0, 0.0, 0.0, 0.0), "y": (HALF, 0.0, 0.0, HALF), "z": (HALF, 0.0, -HALF, 0.0)}
"""Orientations of frames whose x axis is that axis of the body."""
HIPS = {"left front": (1, 1), "right front": (1, -1), "left hind": (-1, 1), "right hind": (-1, -1)}
STANDING = 0.65
"""Height of the trunk's centre above the ground with straight legs [m]."""
HOLD = Spring(stiffness=60.0, damping=2.0)
"""Spring of each hinge of a leg without motors."""
SERVO = Servo(20.0, 30.0, 8.0)
HELD: dict[str, tuple[Motor | None, str]] = {"springs": (None, "Euler"), "servos": (SERVO, "implicitfast")}
"""The motor of each hinge, if any, and MuJoCo's fastest integrator that is stable with it."""


def block(mass: float, *sizes: float) -> tuple[float, ...]:
    """Return the principal moments of a box [kg m^2] with these edges [m]."""
    squares = np.square(sizes)
    return tuple(float(m) for m in mass / 12 * (squares.sum() - squares))


def quadruped(motor: Motor | None = None, spring: Spring | None = None, ground: bool = True) -> World:
    """Return a trunk on four legs of four links: 17 bodies, 16 hinges, 24.4 kg; only its feet touch the ground.

    Each leg turns about z, x and y at its hip, and about y at its knee. No published table robot has its masses stated.
    """
    bodies = [Body("trunk", 10.0, block(10.0, 0.6, 0.3, 0.15))]
    joints: list[Joint] = []
    for name, (x, y) in HIPS.items():
        base, hip = len(bodies), (0.3 * x, 0.2 * y, 0.0)
        bodies += leg(name)
        held = (("z", 0, hip, (0, 0, 0)), ("x", base, (0, 0, 0), (0, 0, 0)), ("y", base + 1, (0, 0, 0), (0, 0, 0.15)))
        for k, (axis, parent, above, below) in enumerate((*held, ("y", base + 2, (0, 0, -0.15), (0, 0, 0.15)))):
            frames = (JointFrame(below, AXES[axis]), JointFrame(above, AXES[axis]))
            joints.append(Joint(f"{name} {k + 1}", HINGE, base + k, parent, frames, motor, spring=spring))
    world = make_world(bodies, [Plane.ground()], Law(0.8))
    pairs = tuple(pair for pair in world.pairs if pair.second.body is None) if ground else ()
    return World(world.bodies, world.statics if ground else (), pairs, joints=tuple(joints))


def leg(name: str) -> list[Body]:
    """Return the bodies of a leg: two rings of a hip, a thigh, a shank with its foot."""
    rings = [Body(f"{name} {part}", 1.0, block(1.0, 0.1, 0.1, 0.1)) for part in ("ring", "fork")]
    thigh = Body(f"{name} thigh", 1.0, block(1.0, 0.06, 0.06, 0.3))
    return [*rings, thigh, Body(f"{name} shank", 0.6, block(0.6, 0.05, 0.05, 0.3), (Sphere(0.05, (0, 0, -0.15)),))]


def chain(count: int = 8, length: float = 0.15, spring: Spring | None = None, motor: Motor | None = None) -> World:
    """Return rods of 0.5 kg that hang on the world by hinges about y, x, y, ...; straight down at coordinates 0."""
    bodies = [Body(f"rod{k}", 0.5, block(0.5, 0.03, 0.03, length)) for k in range(count)]
    joints = []
    for k in range(count):
        turned = AXES["yx"[k % 2]]
        frames = JointFrame((0, 0, length / 2), turned), JointFrame((0, 0, -length / 2 if k else 0), turned)
        joints.append(Joint(f"j{k}", HINGE, k, k - 1 if k else None, frames, motor, spring=spring))
    return World(tuple(bodies), joints=tuple(joints))


@dataclass(frozen=True)
class Pose:
    """A body or a frame: orientation, (3,) position [m], velocity [m/s] and angular velocity [rad/s], world frame."""

    turn: Rotation
    place: Array
    velocity: Array
    spin: Array

    def point(self, arm: Any) -> tuple[Array, Array]:
        """Return the position and the velocity of a point of the body's frame."""
        lever = self.turn.apply(arm)
        return self.place + lever, self.velocity + np.cross(self.spin, lever)

    def values(self, name: str) -> Values:
        """Return the pose by the names of a state."""
        q = self.turn.as_quat(scalar_first=True)
        fields = {"position": self.place, "orientation": q, "velocity": self.velocity, "angular_velocity": self.spin}
        return {f"{name}.{field}": value for field, value in fields.items()}


REST = Pose(Rotation.identity(), np.zeros(3), np.zeros(3), np.zeros(3))


def turns_of(joint: Joint, q: Sequence[float]) -> Rotation:
    """Return the rotation from the first side's frame to the second's; (n,) of a ball joint is a rotation vector."""
    if joint.kind.name == "ball":
        return Rotation.from_rotvec(q)
    axes = {"hinge": "X", "universal": "YX", "slider": "", "fixed": ""}[joint.kind.name]
    return Rotation.from_euler(axes, list(q)) if axes else Rotation.identity()


def state_of(world: World, coordinates: Mapping[str, Any], rates: Mapping[str, Any], root: Pose = REST) -> Values:
    """Return poses and velocities of every body of trees, from coordinates and rates of joints by name.

    Args:
        world: its joints make trees.
        coordinates: [rad] or [m]; a rotation vector (3,) for a ball joint; 0 where not given.
        rates: [rad/s] or [m/s]; ball joints have none.
        root: pose of the root of each tree that floats.
    """
    poses: dict[int, Pose] = {}
    for link in (link for tree in kinematic_trees(world.joints) for link in tree.links):
        if link.joint is None:
            poses[link.body] = root
            continue
        joint = world.joints[link.joint]
        none = np.zeros(len(joint.kind.coordinates) or 3)
        q, speed = (np.atleast_1d(given.get(joint.name, none)) for given in (coordinates, rates))
        parent = REST if link.parent is None else poses[link.parent]
        poses[link.body] = held(joint, link, parent, q, speed)
    return {key: value for k, pose in poses.items() for key, value in pose.values(world.bodies[k].name).items()}


def held(joint: Joint, link: Link, parent: Pose, q: Array, speed: Array) -> Pose:
    """Return the pose of a link from the pose of its parent."""
    own, other = joint.frames if link.sign > 0 else joint.frames[::-1]
    at = parent.turn * of_frame(other)
    turn = turns_of(joint, q)
    frame = at * (turn if link.sign > 0 else turn.inv())
    second = at if link.sign > 0 else frame  # whose axes coordinates count along
    body = frame * of_frame(own).inv()
    place, velocity = parent.point(other.point)
    spin = parent.spin + link.sign * sum((r * axis for r, axis in swung(joint, second, q, speed)), np.zeros(3))
    if joint.kind.name == "slider":
        along = link.sign * second.apply([1, 0, 0])
        place, velocity = place + q[0] * along, velocity + speed[0] * along + np.cross(parent.spin, q[0] * along)
    arm = body.apply(own.point)
    return Pose(body, place - arm, velocity - np.cross(spin, arm), spin)


def of_frame(frame: JointFrame) -> Rotation:
    """Return the rotation from the frame's axes to the body's."""
    return Rotation.from_quat(frame.orientation, scalar_first=True)


def swung(joint: Joint, second: Rotation, q: Array, speed: Array) -> Iterator[tuple[float, Array]]:
    """Yield rates of rotations and their axes, world frame."""
    if joint.kind.name == "hinge":
        yield speed[0], second.apply([1, 0, 0])
    if joint.kind.name == "universal":
        yield speed[0], second.apply([0, 1, 0])
        yield speed[1], (second * Rotation.from_euler("Y", q[0])).apply([1, 0, 0])


@dataclass(frozen=True)
class JointedScene:
    """A robot and a batch of initial states.

    Attributes:
        name: of the scene.
        robot: bodies, joints, ground.
        start: (batch,) initial states by name.
    """

    name: str
    robot: World
    start: tuple[Values, ...]

    def world(self, restitution: float = 0.0) -> World:
        """Return the world with this restitution in all contacts."""
        pairs = tuple(replace(p, law=replace(p.law, restitution=restitution)) for p in self.robot.pairs)
        return replace(self.robot, pairs=pairs)

    def states(self, world: World) -> Array:
        """Return the initial states (batch, nx)."""
        return np.array([np.array(ca.DM(initial_state(world, values))).ravel() for values in self.start])

    def places(self, world: World, X: Array) -> Array:
        """Return the centres (..., bodies, 3) of states (..., nx)."""
        layout = Layout(world)
        return np.stack([X[..., layout[f"{body.name}.position"]] for body in world.bodies], axis=-2)


def standing(motor: Motor | None = None, batch: int = 128) -> JointedScene:
    """Return the quadruped on its four feet, pushed: all of it moves at about 0.3 m/s."""
    rng, robot = np.random.default_rng(0), quadruped(motor, None if motor else HOLD)
    place = np.array([0, 0, STANDING])
    roots = [Pose(Rotation.identity(), place, rng.normal(0, 0.3, 3), np.zeros(3)) for _ in range(batch)]
    return JointedScene("quadruped", robot, tuple(state_of(robot, {}, {}, root) for root in roots))


def swinging(count: int = 8, batch: int = 8) -> JointedScene:
    """Return the chain, let go from a bend; its hinges are damped a little."""
    rng, robot = np.random.default_rng(7), chain(count, spring=Spring(damping=0.002))
    names = [joint.name for joint in robot.joints]
    starts = (dict(zip(names, rng.normal(0, 0.4, count), strict=True)) for _ in range(batch))
    return JointedScene("chain", robot, tuple(state_of(robot, start, {}) for start in starts))
