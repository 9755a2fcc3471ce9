"""The worlds of the study of joints: chains that swing, closed loops, robots that fall on a foot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from robots import AXES, SERVO, JointedScene, Pose, Rotation, block, quadruped, state_of

from symphys.model.joints import HINGE, Joint, JointFrame
from symphys.model.shapes import Plane, Sphere
from symphys.model.world import Body, Law, World, make_world

LENGTH, FOOT = 0.5, 0.05
"""Of a rod, radius of a foot [m]."""
BENT = (0.5, -0.9, 0.8)
"""How the chain that falls is turned at its root and bent at its hinges [rad]."""
TILT = (0.15, 0.2, 0.0)
"""Of the quadruped that falls, so that its feet land one after another; a rotation vector [rad]."""


def swinging(masses: Sequence[float]) -> JointedScene:
    """Rods that hang on the world and on each other by hinges about y, let go from horizontal."""
    robot = World(tuple(rods(masses)), joints=hinges(len(masses)))
    return JointedScene(f"{len(masses)} rods", robot, (state_of(robot, {"j0": [np.pi / 2]}, {}),))


def rods(masses: Sequence[float]) -> list[Body]:
    """Along z."""
    return [Body(f"rod{k}", m, block(m, 0.05, 0.05, LENGTH)) for k, m in enumerate(masses)]


def hinges(count: int, first: int = 0) -> tuple[Joint, ...]:
    """The upper end of each rod on the lower end of the one before; that of the first on the world."""
    upper = hinge_at(0, 0, LENGTH / 2)
    lower = [hinge_at(0, 0, -LENGTH / 2 if k else 0) for k in range(count)]
    return tuple(Joint(f"j{k}", HINGE, k, k - 1 if k else None, (upper, lower[k])) for k in range(first, count))


def hinge_at(x: float, y: float, z: float) -> JointFrame:
    """About y, at a point of the body."""
    return JointFrame((x, y, z), AXES["y"])


def parallelograms(*angles: float) -> JointedScene:
    """Two rods carry a bar of 1 m and 5 kg, two more rods on its ends the next bar, and so on, let go from rest.

    One of the four hinges of each closes a loop. ``angles`` of the rods [rad]: where rods lie along their bar, at a
    right angle, a parallelogram may fold another way, so they must begin too low to come there.
    """
    bodies, joints, start = list[Body](), list[Joint](), dict[str, object]()
    up, low = (hinge_at(0, 0, z) for z in (LENGTH / 2, -LENGTH / 2))
    ends, still, place = [hinge_at(x, 0, 0) for x in (-0.5, 0.5)], np.zeros(3), np.zeros(3)
    for i, angle in enumerate(angles):
        turn = Rotation.from_rotvec([0, angle, 0])
        half = turn.apply([0, 0, -LENGTH / 2])
        for k in range(2):
            bodies.append(replace(rods([1.0])[0], name=f"rod{i}{k}"))
            start |= Pose(turn, place + half + np.array([k - 0.5, 0, 0]), still, still).values(f"rod{i}{k}")
            joints.append(Joint(f"top{i}{k}", HINGE, 3 * i + k, 3 * i - 1 if i else None, (up, ends[k])))
            joints.append(Joint(f"low{i}{k}", HINGE, 3 * i + 2, 3 * i + k, (ends[k], low)))
        place = place + 2 * half
        bodies.append(Body(f"bar{i}", 5.0, block(5.0, 1.0, 0.05, 0.05)))
        start |= Pose(Rotation.identity(), place, still, still).values(f"bar{i}")
    return JointedScene(f"{len(angles)} parallelograms", World(tuple(bodies), joints=tuple(joints)), (start,))


def falling_chain(batch: int = 16, dt: float = 0.01) -> JointedScene:
    """Three rods, bent at their hinges, fall with 2 m/s on the foot of the lowest; it lands all over one step."""
    bodies = rods([1.0, 1.0, 1.0])
    bodies[2] = replace(bodies[2], shapes=(Sphere(FOOT, (0, 0, -LENGTH / 2)),))
    world = make_world(bodies, [Plane.ground()], Law(0.5))
    robot = replace(world, joints=hinges(3, 1))
    bends = {f"j{k}": [BENT[k]] for k in (1, 2)}
    motion = np.array([0.5, 0, -2.0]), np.zeros(3)
    turn = Rotation.from_rotvec([0, BENT[0], 0])
    low = lowest(robot, [state_of(robot, bends, {}, Pose(turn, np.zeros(3), *motion))])
    heights = 0.05 - low + 2.0 * dt * np.arange(batch) / batch
    roots = (Pose(turn, np.array([0, 0, z]), *motion) for z in heights)
    return JointedScene("chain", robot, tuple(state_of(robot, bends, {}, root) for root in roots))


def thrown_chain(batch: int = 16) -> JointedScene:
    """The same chain, bent and turned at random about all axes, spinning: blows far off its centres."""
    rng, robot = np.random.default_rng(4), falling_chain(1).robot
    starts = []
    for turn in Rotation.random(batch, rng):
        bends, rates = ({f"j{k}": rng.normal(0, size, 1) for k in (1, 2)} for size in (0.8, 2.0))
        root = Pose(turn, np.zeros(3), np.array([1.0, 0.5, -2.0]), rng.uniform(-4, 4, 3))
        low = lowest(robot, [state_of(robot, bends, rates, root)])
        starts.append(state_of(robot, bends, rates, replace(root, place=np.array([0, 0, 0.05 - low]))))
    return JointedScene("thrown chain", robot, tuple(starts))


def falling_quadruped(batch: int = 8) -> JointedScene:
    """The quadruped falls on a foot from 5 cm and a little more, tilted, its legs held straight by servos."""
    robot, still = quadruped(SERVO), np.zeros(3)
    turn = Rotation.from_rotvec(TILT)
    low = lowest(robot, [state_of(robot, {}, {}, Pose(turn, still, still, still))])
    heights = 0.05 - low + 0.01 * np.arange(batch) / batch
    roots = (Pose(turn, np.array([0, 0, z]), still, still) for z in heights)
    return JointedScene("quadruped", robot, tuple(state_of(robot, {}, {}, root) for root in roots))


def lowest(robot: World, starts: Sequence[dict[str, object]]) -> float:
    """The height of the lowest point of all feet [m]."""
    heights = []
    for start in starts:
        for body in robot.bodies:
            for shape in body.shapes:
                turn = Rotation.from_quat(start[f"{body.name}.orientation"], scalar_first=True)
                place = start[f"{body.name}.position"] + turn.apply(shape.centre)
                heights.append(place[2] - shape.radius)
    return float(min(heights))


def given_way(scene: JointedScene, frequency: float = 200.0) -> JointedScene:
    """The same with joints that give way, critically damped: no trees then, sweeps visit each joint as a row.

    Rigid joints always make trees; a high frequency [Hz] is how joints can be made rows.
    """
    joints = tuple(replace(joint, frequency=frequency) for joint in scene.robot.joints)
    return replace(scene, name=f"{scene.name}, rows", robot=replace(scene.robot, joints=joints))
