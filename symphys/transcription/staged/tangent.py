"""The tangent of a state: minimal coordinates of its changes, poses and velocities first, forces last.

Of each kinematic tree its coordinates and then their rates; of each other body its position, a rotation vector (world
frame), velocity and angular velocity; then the numbers that are their own tangent: forces of pairs, joints and
couplings, the whole turns of joints that close loops or are soft, the torque (3) with which contacts act on each body
that has pairs, ``lag`` if impacts cut steps or the time step varies, and what sensors remember. All reactions of bodies
follow from these. A step leaves its trees' joints closed to rounding, so that nothing of its state is lost; what an
initial state is off them is kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from symphys.dynamics.articulated.forward_kinematics import WORLD_POSE, JointStart, final_poses
from symphys.dynamics.context import make_context
from symphys.dynamics.joints.joint_frames import JointFrames, joint_frames_at
from symphys.dynamics.joints.warm_start import add_joint_forces
from symphys.dynamics.prediction import bodies_of, jointed_bodies
from symphys.dynamics.step import max_splits
from symphys.maths import rotation
from symphys.model.joints import Joint, JointFrame, KinematicTree, Link, kinematic_trees, tree_joints
from symphys.model.state_layout import BODY_FIELDS, Layout
from symphys.records import dataclass
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.stage_functions import ByColumns
from symphys.types import Array, Expr

Pose = tuple[Expr, Expr]
"""Position (3,) and orientation (4,)."""
Moving = tuple[Expr, Expr]
"""Velocity and angular velocity, (3,) each."""
START = ca.SX(0)
"""[s] since the state."""
IDENTITY_POSE: Pose = (ca.SX.zeros(3), ca.SX([1, 0, 0, 0]))
"""The pose of the world."""


@dataclass(frozen=True)
class JointCoordinateChart:
    """Joint coordinates of a kinematic tree about a state: to poses and velocities of its bodies, and back.

    Coordinates are increments: of a floating root its position (3) [m] and a rotation vector (3) [rad], world frame; of
    each joint its free coordinates, [rad] or [m]. A ball joint rotates about the axes of its second frame. Rates of a
    root are velocity [m/s] and angular velocity [rad/s], world frame. The violation of joints in a state is kept. All
    mappings have bodies as keys.
    """

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
            parent = IDENTITY_POSE if link.parent is None else found[link.parent]
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
        second = IDENTITY_POSE if joint.second is None else poses[joint.second]
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
        return JointStart(ordered, placed.apart, joint.kind.axes(placed), WORLD_POSE.turn)

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


Parts = Mapping[str, Expr]
"""Parts of a state by the names of ``Layout``."""
POSES, VELOCITIES, REACTIONS = BODY_FIELDS[:2], BODY_FIELDS[2:4], BODY_FIELDS[4:]


@dataclass(frozen=True, eq=False)
class Tangent:
    """The tangent of a rollout's states.

    States are (nx,), with what sensors remember at their end; tangents are (n,). ``p`` (np,) are the rollout's
    parameters: they matter where a variable moves a joint.
    """

    rollout: Rollout
    kind: ClassVar[str] = "with forces"

    @cached_property
    def size(self) -> int:
        """Return the tangent dimension ``n``."""
        return len(self.names)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the labels: ``torso.position[0]``, ``knee.coordinate[0]``, ``knee.rate[0]``, ``foot.force[2]``."""
        found = []
        for (index, chart), kinds in ((each, kinds) for each in self._charts for kinds in ("coordinate", "rate")):
            fields = ("position", "turn") if kinds == "coordinate" else ("velocity", "angular_velocity")
            for link in chart.tree.links if chart else ():
                if link.joint is None:
                    body = self.rollout.world.bodies[link.body].name
                    found += [f"{body}.{field}[{k}]" for field in fields for k in range(3)]
                else:
                    joint = self.rollout.world.joints[link.joint].name
                    found += [f"{joint}.{kinds}[{k}]" for k in range(link.count)]
            if chart is None:
                body = self.rollout.world.bodies[index].name
                found += [f"{body}.{field}[{k}]" for field in fields for k in range(3)]
        return (*found, *(f"{name}[{k}]" for name, size in self._other_entries for k in range(size)))

    @cached_property
    def retraction(self) -> ca.Function:
        """(x, d, p) -> retract(x, d), the state at the tangent d from x."""
        x, d, p = ca.SX.sym("x", self._layout_size), ca.SX.sym("d", self.size), self._p
        return ca.Function("retract", [x, d, p], [ca.densify(ca.cse(self._retracted(x, d)))])

    @cached_property
    def distance(self) -> ca.Function:
        """(x, y, p) -> d with retract(x, d) = y."""
        x, y, p = ca.SX.sym("x", self._layout_size), ca.SX.sym("y", self._layout_size), self._p
        return ca.Function("difference", [x, y, p], [ca.densify(ca.cse(self._difference(x, y)))])

    @cached_property
    def basis(self) -> ca.Function:
        """(x, p) -> (nx, n) the derivative of retract(x, d) by d, at d = 0."""
        x, d, p = ca.SX.sym("x", self._layout_size), ca.SX.sym("d", self.size), self._p
        slope = ca.substitute(ca.jacobian(self.retraction(x, d, p), d), d, ca.SX.zeros(self.size))
        return ca.Function("basis", [x, p], [ca.cse(slope)])

    @cached_property
    def projection(self) -> ca.Function:
        """(x, p) -> (n, nx) the derivative of difference(x, y) by y, at y = x."""
        x, y, p = ca.SX.sym("x", self._layout_size), ca.SX.sym("y", self._layout_size), self._p
        slope = ca.substitute(ca.jacobian(self.distance(x, y, p), y), y, x)
        return ca.Function("projection", [x, p], [ca.cse(slope)])

    @cached_property
    def shift(self) -> ca.Function:
        """(x, p) -> (nx, np) the derivative of a state by p at a fixed tangent, where p moves joints."""
        x, p = ca.SX.sym("x", self._layout_size), self._p
        old = self._parts(x)
        kept, rebuilt = self._at_fixed_errors(old)
        slope = ca.jacobian(rebuilt, p) if p.numel() else ca.SX(self._layout.size, 0)
        if slope.nnz():
            known = ca.vertcat(ca.SX(0, 1), *(value for _, value in kept))
            symbols = ca.vertcat(ca.SX(0, 1), *(symbol for symbol, _ in kept))
            slope = ca.cse(ca.substitute(slope, symbols, known))
        memory = ca.SX(self._layout_size - self._layout.size, slope.size2())
        return ca.Function("shift", [x, p], [ca.vertcat(slope, memory)])

    def retract(self, X: ArrayLike, D: ArrayLike, p: ArrayLike | None = None) -> Array:
        """Return the states (B, nx) at tangents D (B, n) from X (B, nx); ``p`` None: the guess's parameters."""
        return self._batch(self._retractions, (X, D), p)

    def difference(self, X: ArrayLike, Y: ArrayLike, p: ArrayLike | None = None) -> Array:
        """Return D (B, n) with retract(X, D) = Y, for X and Y (B, nx)."""
        return self._batch(self._distances, (X, Y), p)

    @cached_property
    def nominal(self) -> Array:
        """The parameters (np,) of the guess."""
        return np.array(ca.DM(ca.vertcat(ca.DM(0, 1), *self.rollout.parameters.nominal))).ravel()

    @cached_property
    def shifts(self) -> bool:
        """Whether parameters move joints."""
        return bool(self.shift.nnz_out(0))

    @cached_property
    def _retractions(self) -> ByColumns:
        return ByColumns(self.retraction)

    @cached_property
    def _distances(self) -> ByColumns:
        return ByColumns(self.distance)

    def _batch(self, function: ByColumns, rows: tuple[ArrayLike, ArrayLike], p: ArrayLike | None) -> Array:
        first, second = (np.asarray(each, float) for each in rows)
        given = ca.DM(self.nominal if p is None else np.asarray(p, float))
        if not len(first):
            return np.zeros((0, function.function.size1_out(0)))
        (found,) = function(first.T, second.T, ca.repmat(given, 1, len(first)))
        return np.ascontiguousarray(found.T)

    @property
    def _p(self) -> Expr:
        return ca.vertcat(ca.SX(0, 1), *self.rollout.parameters.symbols)

    @property
    def _layout_size(self) -> int:
        """Return the size ``nx`` of a state."""
        return self.rollout.memory.size

    @cached_property
    def _layout(self) -> Layout:
        return Layout(self.rollout.world)

    @cached_property
    def _charts(self) -> tuple[tuple[int, JointCoordinateChart | None], ...]:
        """Yield each tree with the index of its root, then each free body with its index."""
        world = self.rollout.world
        trees = kinematic_trees(world.joints)
        held = {body for tree in trees for body in tree.bodies}
        free = ((i, None) for i in range(len(world.bodies)) if i not in held)
        return (*((tree.root, JointCoordinateChart(tree, world.joints)) for tree in trees), *free)

    @cached_property
    def _plain_parts(self) -> tuple[tuple[str, int], ...]:
        """Return the parts of the world's state that are their own tangent, and their sizes."""
        world, scheme = self.rollout.world, self.rollout.problem.simulation.scheme()
        of_bodies = {f"{body.name}.{field}" for body in world.bodies for field, _ in BODY_FIELDS}
        in_trees = {joint.unwrapped for joint in self._in_trees}
        implied = of_bodies | in_trees | self._left_out
        names = [name for name in self._layout.names() if name not in implied and name != "lag"]
        if max_splits(world, scheme) or self.rollout.problem.free_duration:  # half a step, without impacts
            names.append("lag")
        parts = [(name, self._layout[name]) for name in names]
        return tuple((name, part.stop - part.start) for name, part in parts)

    @cached_property
    def _left_out(self) -> frozenset[str]:
        """Return the parts of the state that stay as they are, whatever the tangent."""
        return frozenset()

    @cached_property
    def _in_trees(self) -> tuple[Joint, ...]:
        """Return the joints whose coordinates are entries of the tangent."""
        joints = self.rollout.world.joints
        return tuple(joints[k] for k in sorted(tree_joints(joints)))

    def _angle_changes(self, old: Parts, new: Parts) -> dict[str, Expr]:
        """Return changes of angle of the other joints between two poses, by half a turn at most."""
        found, world = dict[str, Expr](), self.rollout.world
        for joint in world.joints:
            if joint.unwrapped is None or joint in self._in_trees:
                continue
            near, angles = old[joint.unwrapped], list[Expr]()
            for state in (old, new):
                poses = tuple(self._pair(state, i, POSES) for i in joint.bodies)
                placed = joint_frames_at(joint, poses).placed(ca.SX(0))
                angles.append(ca.vertcat(*(joint.value(k, placed, near) for k in range(near.numel()))))
            found[joint.unwrapped] = angles[1] - angles[0]
        return found

    @cached_property
    def _independent_reactions(self) -> tuple[str, ...]:
        """Return the independent reactions: torques of contacts; without warm start all reactions."""
        world = self.rollout.world
        touching = {i for pair in world.pairs for i in bodies_of(pair)}
        if self.rollout.problem.simulation.scheme().warm_start:
            return tuple(f"{world.bodies[i].name}.reaction_torque" for i in sorted(touching))
        acted = sorted(touching | jointed_bodies(world))
        return tuple(f"{world.bodies[i].name}.{field}" for i in acted for field, _ in REACTIONS)

    @cached_property
    def _other_entries(self) -> tuple[tuple[str, int], ...]:
        """Return all entries after coordinates and rates, by name, with sizes."""
        torques = tuple((name, 3) for name in self._independent_reactions)
        memory = self._layout_size - self._layout.size
        return (*self._plain_parts, *torques, *((("memory", memory),) if memory else ()))

    def _retracted(self, x: Expr, d: Expr) -> Expr:
        old, cursor = self._parts(x), _Cursor(d)
        new, faster = dict(old), list[Expr]()
        # Poses: of free bodies directly, of trees in joint coordinates.
        for index, chart in self._charts:
            poses = self._pairs(old, index, chart, POSES)
            if chart is None:
                (place, turned), (along, about) = poses[index], (cursor.take(3), cursor.take(3))
                moved = {index: (place + along, rotation.multiply(rotation.exponential(about), turned))}
            else:
                along = cursor.take(chart.tree.size)
                moved = chart.displaced(poses, along)
                new |= chart.displaced_angles(old, along)
            faster.append(cursor.take(6 if chart is None else chart.tree.size))
            for i, pose in moved.items():
                self._set_pair(new, i, POSES, pose)
        # Entries that are their own tangent; whole turns follow the poses.
        turned = self._angle_changes(old, new)
        for name, size in self._plain_parts:
            new[name] = old[name] + cursor.take(size) + turned.get(name, 0)
        # Reactions: the loads of pairs and joints at the new state, plus the independent part.
        others = {name: cursor.take(3) for name in self._independent_reactions}
        for body, first, second in zip(
            self.rollout.world.bodies, self._constraint_loads(old), self._constraint_loads(new), strict=True
        ):
            for (field, _), a, b in zip(REACTIONS, first, second, strict=True):
                new[f"{body.name}.{field}"] = old[f"{body.name}.{field}"] + (b - a)
        for name, each in others.items():
            new[name] += each
        # Velocities: of free bodies directly, of trees as rates.
        for (index, chart), more in zip(self._charts, faster, strict=True):
            poses, moving = (self._pairs(old, index, chart, fields) for fields in (POSES, VELOCITIES))
            rates = more + self._kick_change(old, new, index, chart)
            if chart is None:
                velocity, spin = moving[index]
                after = {index: (velocity + rates[:3], spin + rates[3:])}
            else:
                after = _transport_velocities(chart, poses, moving, self._pairs(new, index, chart, POSES), rates)
            for i, each in after.items():
                self._set_pair(new, i, VELOCITIES, each)
        return ca.vertcat(self._layout.pack(new), x[self._layout.size :] + d[cursor.at :])

    def _difference(self, x: Expr, y: Expr) -> Expr:
        old, new = self._parts(x), self._parts(y)
        found: list[Expr] = []
        # Poses and velocities: free bodies directly, trees in joint coordinates.
        for index, chart in self._charts:
            places = [self._pairs(state, index, chart, POSES) for state in (old, new)]
            moving = [self._pairs(state, index, chart, VELOCITIES) for state in (old, new)]
            if chart is None:
                before, after = (each[index] for each in places)
                found += [after[0] - before[0], rotation.between(before[1], after[1])]
                faster = ca.vertcat(*(b - a for a, b in zip(moving[0][index], moving[1][index], strict=True)))
            else:
                rates = [chart.rates(*each) for each in zip(places, moving, strict=True)]
                found.append(chart.difference(places[0], places[1], (old, new)))
                faster = rates[1] - rates[0]
            found.append(faster - self._kick_change(old, new, index, chart))
        # Entries that are their own tangent; whole turns follow the poses.
        turned = self._angle_changes(old, new)
        found += [new[name] - old[name] - turned.get(name, 0) for name, _ in self._plain_parts]
        # Independent reactions: changes that the loads of pairs and joints do not explain.
        for body, first, second in zip(
            self.rollout.world.bodies, self._constraint_loads(old), self._constraint_loads(new), strict=True
        ):
            for k, (field, _) in enumerate(REACTIONS):
                if (name := f"{body.name}.{field}") in self._independent_reactions:
                    found.append(new[name] - old[name] - (second[k] - first[k]))
        return ca.vertcat(ca.SX(0, 1), *found, y[self._layout.size :] - x[self._layout.size :])

    def _kick_change(self, old: Parts, new: Parts, index: int, chart: JointCoordinateChart | None) -> Expr | float:
        """Return what changes of velocity or rates, (6,) or (size,), are no part of the tangent."""
        return 0.0

    def _at_fixed_errors(self, old: Parts) -> tuple[list[tuple[Expr, Expr]], Expr]:
        """Return the state as a function of joint errors, rates and reactions: symbols with values, and the state."""
        kept, new = list[tuple[Expr, Expr]](), dict(old)

        def known(value: Expr) -> Expr:
            kept.append((ca.SX.sym("kept", value.numel()), value))
            return kept[-1][0]

        # Poses of trees by their joint errors; velocities by rates and their deviation from the joints.
        for _, chart in self._charts:
            if chart is None:
                continue
            bodies = chart.tree.bodies
            poses, moving = ({i: self._pair(old, i, fields) for i in bodies} for fields in (POSES, VELOCITIES))
            rates = chart.rates(poses, moving)
            fit, moved = (
                chart.velocities(poses, rates),
                chart.poses_with_errors(poses, known(chart.joint_errors(poses, old))),
            )
            after = chart.velocities(moved, known(rates))
            for i in bodies:
                off = (known(now - then) for now, then in zip(moving[i], fit[i], strict=True))
                self._set_pair(new, i, POSES, moved[i])
                both = [value + more for value, more in zip(after[i], off, strict=True)]
                self._set_pair(new, i, VELOCITIES, (both[0], both[1]))
        # Reactions by their deviation from the loads of pairs and joints.
        for body, first, second in zip(
            self.rollout.world.bodies, self._constraint_loads(old), self._constraint_loads(new), strict=True
        ):
            for (field, _), a, b in zip(REACTIONS, first, second, strict=True):
                new[f"{body.name}.{field}"] = known(old[f"{body.name}.{field}"] - a) + b
        return kept, self._layout.pack(new)

    def _constraint_loads(self, state: Parts) -> list[tuple[Expr, Expr]]:
        """Return force and torque on each body from the forces of pairs and joints in the state."""
        world = self.rollout.world
        total = [(ca.SX.zeros(3), ca.SX.zeros(3)) for _ in world.bodies]
        for pair in world.pairs:
            sides = [(side.body, sign) for side, sign in ((pair.first, 1), (pair.second, -1)) if side.body is not None]
            for body, sign in sides:
                total[body] = total[body][0] + sign * state[f"{pair.name}.force"], total[body][1]
        poses = [self._pair(state, i, POSES) for i in range(len(world.bodies))]
        context = make_context(world, self.rollout.problem.simulation.scheme(), (), ca.SX(0, 1), ca.SX(0))
        add_joint_forces(context, dict(state), poses, total)
        return total

    def _parts(self, x: Expr) -> dict[str, Expr]:
        return {name: x[self._layout[name]] for name in self._layout.names()}

    def _pair(self, state: Parts, index: int, fields: tuple[tuple[str, int], ...]) -> Pose | Moving:
        name = self.rollout.world.bodies[index].name
        return state[f"{name}.{fields[0][0]}"], state[f"{name}.{fields[1][0]}"]

    def _pairs(
        self, state: Parts, index: int, chart: JointCoordinateChart | None, fields: tuple[tuple[str, int], ...]
    ) -> dict[int, Any]:
        """Return poses or velocities of the bodies of a chart, or of a free body."""
        return {i: self._pair(state, i, fields) for i in ((index,) if chart is None else chart.tree.bodies)}

    def _set_pair(
        self, state: dict[str, Expr], index: int, fields: tuple[tuple[str, int], ...], both: Pose | Moving
    ) -> None:
        name = self.rollout.world.bodies[index].name
        for (field, _), value in zip(fields, both, strict=True):
            state[f"{name}.{field}"] = value


class _Cursor:
    """Takes consecutive parts of a column."""

    def __init__(self, column: Expr) -> None:
        self.column, self.at = column, 0

    def take(self, count: int) -> Expr:
        """Return the next ``count`` numbers."""
        self.at += count
        return self.column[self.at - count : self.at]


def _transport_velocities(
    chart: JointCoordinateChart,
    poses: Mapping[int, Pose],
    moving: Mapping[int, Moving],
    moved: Mapping[int, Pose],
    more: Expr,
) -> dict[int, Moving]:
    """Return velocities at the new poses, with rates changed by ``more`` and the same violation of joints."""
    rates = chart.rates(poses, moving)
    fit, after = chart.velocities(poses, rates), chart.velocities(moved, rates + more)
    return {i: (after[i][0] + (moving[i][0] - fit[i][0]), after[i][1] + (moving[i][1] - fit[i][1])) for i in after}
