"""Joint coordinates of a kinematic tree about a state: to poses and velocities of its bodies, and back.

Coordinates are increments: of a root that floats its position (3) [m] and a rotation vector (3) [rad], world frame; of
each joint what it leaves free, [rad] or [m]. A ball joint turns about the axes of its second frame. Rates are those of
the same: of a root velocity [m/s] and angular velocity [rad/s], world frame. What a state is off its joints is kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from symphys.dynamics.articulated.forward_kinematics import HERE, JointStart, final_poses
from symphys.dynamics.joints.joint_frames import JointFrames, joint_frames_at
from symphys.maths import rotation
from symphys.model.joints import Joint, JointFrame, KinematicTree, Link
from symphys.types import Expr

Pose = tuple[Expr, Expr]
"""Position (3,) and orientation (4,)."""
Moving = tuple[Expr, Expr]
"""Velocity and angular velocity, (3,) each."""
START = ca.SX(0)
WORLD_POSE: Pose = (ca.SX.zeros(3), ca.SX([1, 0, 0, 0]))
"""The pose of the world."""


@dataclass(frozen=True)
class JointCoordinateChart:
    """A chart of a tree in joint coordinates; all mappings have bodies as keys."""

    tree: KinematicTree
    joints: Sequence[Joint]

    def displaced(self, poses: Mapping[int, Pose], along: Expr) -> dict[int, Pose]:
        """Return the poses after the coordinates changed by ``along`` (size,)."""
        own = tuple(None if link.joint is None else self.joints[link.joint] for link in self.tree.links)
        starts = [None if joint is None else self._start(link, joint, poses) for link, joint in self._links()]
        places = [poses[link.body][0] for link in self.tree.links]
        parts = [along[list(link.coordinates)] for link in self.tree.links]
        arrived = final_poses(self.tree, own, starts, places, parts)
        return {
            link.body: (each.position, rotation.multiply(each.turn, poses[link.body][1]))
            for link, each in zip(self.tree.links, arrived, strict=True)
        }

    def difference(
        self,
        before: Mapping[int, Pose],
        after: Mapping[int, Pose],
        angles: tuple[Mapping[str, Expr], Mapping[str, Expr]],
    ) -> Expr:
        """Return (size,) the change of coordinates between two poses, whole turns included.

        ``angles``: of both, ``Joint.unwrapped`` by its name.
        """
        found = []
        for link, joint in self._links():
            if joint is None:
                (p, q), (r, s) = before[link.body], after[link.body]
                found += [r - p, rotation.between(q, s)]
            elif joint.kind.coordinates:
                old, new = (self.coordinates(joint, *each) for each in zip((before, after), angles, strict=True))
                found.append(new - old)
            elif link.count:
                placed = self._frames(joint, before).placed(START)
                found.append(ca.mtimes(placed.b[:, : link.count].T, self._turned(link, before, after)))
        return ca.vertcat(ca.SX(0, 1), *found)

    def displaced_angles(self, angles: Mapping[str, Expr], along: Expr) -> dict[str, Expr]:
        """Return ``Joint.unwrapped`` by name, after coordinates changed by ``along`` (size,)."""
        return {
            joint.unwrapped: angles[joint.unwrapped] + along[list(link.coordinates)]
            for link, joint in self._links()
            if joint is not None and joint.unwrapped is not None
        }

    def coordinates(self, joint: Joint, poses: Mapping[int, Pose], angles: Mapping[str, Expr]) -> Expr:
        """Return (count,) of a joint; ``angles``: ``Joint.unwrapped`` by its name."""
        placed = self._frames(joint, poses).placed(START)
        near = ca.SX(0, 1) if joint.unwrapped is None else angles[joint.unwrapped]
        return ca.vertcat(*(joint.value(k, placed, near) for k in range(len(joint.kind.coordinates))))

    def rates(self, poses: Mapping[int, Pose], moving: Mapping[int, Moving]) -> Expr:
        """Return rates (size,) of bodies at these poses with these velocities."""
        found = []
        for link, joint in self._links():
            if joint is None:
                found += [*moving[link.body]]
                continue
            frames = self._frames(joint, poses)
            placed, arms = frames.placed(START), frames.lever_arms(START)
            linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
            for sign, arm, body in zip((1, -1), arms, joint.bodies, strict=False):
                velocity, spin = moving[body]
                linear += sign * (velocity + ca.cross(spin, arm))
                angular += sign * spin
            found += joint.kind.rates(placed, linear, angular)
        return ca.vertcat(ca.SX(0, 1), *found)

    def velocities(self, poses: Mapping[int, Pose], rates: Expr) -> dict[int, Moving]:
        """Return the velocities of the bodies at these poses from the rates (size,)."""
        found: dict[int, Moving] = {}
        for link, joint in self._links():
            own = rates[list(link.coordinates)]
            if joint is None:
                found[link.body] = own[:3], own[3:]
                continue
            frames = self._frames(joint, poses)
            arms = frames.lever_arms(START)
            above, mine = (arms[1], arms[0]) if link.sign > 0 else arms
            velocity, spin = (ca.SX.zeros(3), ca.SX.zeros(3)) if link.parent is None else found[link.parent]
            linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
            for k, (slide, turn) in enumerate(joint.kind.motions(frames.placed(START))):
                linear, angular = linear + own[k] * slide, angular + own[k] * turn
            after = spin + link.sign * angular
            at = velocity + ca.cross(spin, above) + link.sign * linear
            found[link.body] = at - ca.cross(after, mine), after
        return found

    def joint_errors(self, poses: Mapping[int, Pose], angles: Mapping[str, Expr]) -> Expr:
        """Return the errors of joints (7 each): rotation (4), offset in the second frame (3) [m].

        For a screw its coordinate follows, and the place is that at coordinate 0. ``angles``: see ``coordinates``.
        """
        found = []
        for _, joint in self._links():
            if joint is not None:
                (first, a), (second, b) = self._sides(joint, poses)
                found += [rotation.multiply(inverse(b), a), rotation.rotate(inverse(b), first - second)]
                if joint.kind.screws:
                    found.append(self.coordinates(joint, poses, angles))
                    found[-2] = found[-2] - _along(joint, found[-1])
        return ca.vertcat(ca.SX(0, 1), *found)

    def poses_with_errors(self, poses: Mapping[int, Pose], held: Expr) -> dict[int, Pose]:
        """Return the poses with joint errors ``held``; a floating root keeps its pose."""
        found, row = dict[int, Pose](), 0
        for link, joint in self._links():
            if joint is None:
                found[link.body] = poses[link.body]
                continue
            turn, apart = held[row : row + 4], held[row + 4 : row + 7]
            row += 7
            if joint.kind.screws:
                apart = apart + _along(joint, held[row : row + link.count])
                row += link.count
            own, other = joint.frames if link.sign > 0 else joint.frames[::-1]
            parent = WORLD_POSE if link.parent is None else found[link.parent]
            place, q = _frame(parent, other)
            if link.sign > 0:
                place, q = place + rotation.rotate(q, apart), rotation.multiply(q, turn)
            else:
                q = rotation.multiply(q, inverse(turn))
                place = place - rotation.rotate(q, apart)
            q = rotation.multiply(q, inverse(ca.vertcat(*own.orientation)))
            found[link.body] = place - rotation.rotate(q, ca.vertcat(*own.point)), q
        return found

    def _sides(self, joint: Joint, poses: Mapping[int, Pose]) -> tuple[Pose, Pose]:
        """Return the poses of the frames of both sides."""
        second = WORLD_POSE if joint.second is None else poses[joint.second]
        return _frame(poses[joint.first], joint.frames[0]), _frame(second, joint.frames[1])

    def _links(self) -> Iterator[tuple[Link, Joint | None]]:
        for link in self.tree.links:
            yield link, None if link.joint is None else self.joints[link.joint]

    def _frames(self, joint: Joint, poses: Mapping[int, Pose]) -> JointFrames:
        return joint_frames_at(joint, tuple(poses[i] for i in joint.bodies))

    def _start(self, link: Link, joint: Joint, poses: Mapping[int, Pose]) -> JointStart:
        """Return the joint's start; its violation is part of the distance of its sides."""
        frames = self._frames(joint, poses)
        placed, arms = frames.placed(START), tuple(arm.at(START) for arm in frames.arms)
        ordered = (arms[1], arms[0]) if link.sign > 0 else (arms[0], arms[1])
        return JointStart(ordered, placed.apart, joint.kind.axes(placed), HERE.turn)

    def _turned(self, link: Link, before: Mapping[int, Pose], after: Mapping[int, Pose]) -> Expr:
        """Return (3,) the rotation vector of a ball joint's first side against its second."""
        own = rotation.multiply(after[link.body][1], inverse(before[link.body][1]))
        if link.parent is not None:
            parent = rotation.multiply(after[link.parent][1], inverse(before[link.parent][1]))
            own = rotation.multiply(inverse(parent), own)
        return link.sign * rotation.logarithm(own)


def _along(joint: Joint, values: Expr) -> Expr:
    """Return the displacement (3,) [m] of the first frame by coordinates (count,), in the second frame."""
    axes = ca.DM.eye(3)[:, [each.axis for each in joint.kind.coordinates]]
    return joint.kind.transform(axes, values)[1]


def _frame(pose: Pose, frame: JointFrame) -> Pose:
    place, q = pose
    return place + rotation.rotate(q, ca.vertcat(*frame.point)), rotation.multiply(q, ca.vertcat(*frame.orientation))


def inverse(q: Expr) -> Expr:
    """Return the inverse (4,) of a unit quaternion."""
    return ca.vertcat(q[0], -q[1:4])
