"""A robot here and in MuJoCo: the same state of both, from MuJoCo's coordinates; masses and mass matrices of both."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import mujoco
import numpy as np
from robots import Pose, Values, state_of
from scipy.spatial.transform import Rotation

from symphys.model.joints import kinematic_trees, tree_joints
from symphys.model.joints.joint import Limits
from symphys.model.state_layout import initial_state
from symphys.model.world import World
from symphys.types import Array

FREE = int(mujoco.mjtJoint.mjJNT_FREE)
BALL = int(mujoco.mjtJoint.mjJNT_BALL)
SWITCHED_OFF = ("CONTACT", "LIMIT", "FRICTIONLOSS", "EQUALITY", "ACTUATION")


class Unmatched(Exception):
    """The two robots do not have the same parts."""


@dataclass(frozen=True)
class Root:
    """A body that floats in both.

    Attributes:
        body: its index here.
        there: in MuJoCo.
        arm: (3,) from MuJoCo's origin of the body to the centre of mass here, MuJoCo's frame of the body [m].
        turn: from the frame here to MuJoCo's.
    """

    body: int
    there: int
    arm: Array
    turn: Rotation


@dataclass(frozen=True)
class Match:
    """A world and MuJoCo's model of the same robot.

    Attributes:
        world: here, of numbers.
        start: orientations of its bodies where all coordinates are 0, by name.
        model: in MuJoCo; armature and damping of its free joints are 0, which have no counterpart.
    """

    world: World
    start: Mapping[str, Any]
    model: mujoco.MjModel

    @cached_property
    def data(self) -> mujoco.MjData:
        """Of the model."""
        return mujoco.MjData(self.model)

    @cached_property
    def joints(self) -> dict[str, int]:
        """MuJoCo's joint of each joint here that has coordinates, by name."""
        names = {plain(self.model.joint(j).name): j for j in range(self.model.njnt)}
        found = {joint.name: names.get(plain(joint.name), -1) for joint in self.world.joints if moves(joint)}
        missing = [name for name, j in found.items() if j < 0]
        rest = [j for j in range(self.model.njnt) if self.model.jnt_type[j] != FREE and j not in found.values()]
        if len(missing) != len(rest):
            there = [self.model.joint(j).name for j in rest]
            raise Unmatched(f"joints here that MuJoCo has not: {missing}; MuJoCo's that are not here: {there}")
        return found | dict(zip(missing, rest, strict=True))

    @cached_property
    def bodies(self) -> dict[str, int]:
        """MuJoCo's body of each body here, as far as one has its name."""
        names = {plain(self.model.body(b).name): b for b in range(1, self.model.nbody)}
        return {body.name: names[plain(body.name)] for body in self.world.bodies if plain(body.name) in names}

    @cached_property
    def trees(self) -> list[tuple[int, ...]]:
        """The bodies that hang together here, a lone one too."""
        found = [tree.bodies for tree in kinematic_trees(self.world.joints)]
        held = {body for bodies in found for body in bodies}
        return found + [(k,) for k in range(len(self.world.bodies)) if k not in held]

    @cached_property
    def roots(self) -> list[Root]:
        """One for each tree that floats."""
        free = {int(self.model.jnt_bodyid[j]) for j in range(self.model.njnt) if self.model.jnt_type[j] == FREE}
        held = {
            link.body for tree in kinematic_trees(self.world.joints) for link in tree.links if link.joint is not None
        }
        found = []
        for bodies in self.trees:
            if all(body in held for body in bodies):
                continue
            own = [k for k in bodies if self.bodies.get(self.world.bodies[k].name) in free]
            if len(own) != 1:
                raise Unmatched(f"{self.world.bodies[bodies[0]].name}: {len(own)} bodies of its tree float in MuJoCo")
            found.append(self._root(own[0]))
        return found

    def _root(self, k: int) -> Root:
        name = self.world.bodies[k].name
        there = self.bodies[name]
        self._place(self.model.qpos0)
        axes = self.data.xmat[there].reshape(3, 3)
        welded = np.flatnonzero(self.model.body_weldid == there)
        weights = self.model.body_mass[welded]
        centre = weights @ self.data.xipos[welded] / weights.sum()
        turn = Rotation.from_matrix(axes).inv() * orientation(self.start.get(f"{name}.orientation", (1, 0, 0, 0)))
        return Root(k, there, axes.T @ (centre - self.data.xpos[there]), turn)

    def _place(self, qpos: Array, qvel: Array | float = 0.0) -> None:
        self.data.qpos[:], self.data.qvel[:] = qpos, qvel
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_comVel(self.model, self.data)

    def state(self, qpos: Array, qvel: Array) -> Values:
        """Poses and velocities here, by name, from MuJoCo's coordinates and velocities."""
        angles, rates = {}, {}
        for name, j in self.joints.items():
            q, v = self.model.jnt_qposadr[j], self.model.jnt_dofadr[j]
            if self.model.jnt_type[j] == BALL:
                raise Unmatched(f"{name} is a ball joint")
            angles[name], rates[name] = [qpos[q] - self.model.qpos0[q]], [qvel[v]]
        values, roots = state_of(self.world, angles, rates), self.roots
        self._place(qpos, qvel)
        for root in roots:
            self._carry(values, root)
        return values

    def _carry(self, values: Values, root: Root) -> None:
        """Move a tree as a whole, in place, so that its root is where and as fast as MuJoCo's."""
        axes = Rotation.from_matrix(self.data.xmat[root.there].reshape(3, 3))
        motion = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, root.there, motion, 0)
        arm = axes.apply(root.arm)
        pose = Pose(
            axes * root.turn, self.data.xpos[root.there] + arm, motion[3:] + np.cross(motion[:3], arm), motion[:3]
        )
        bodies = next(tree for tree in self.trees if root.body in tree)
        if len(bodies) == 1:
            values |= pose.values(self.world.bodies[root.body].name)
            return
        before = pose_of(values, self.world.bodies[root.body].name)
        whole = pose.turn * before.turn.inv()
        spin = pose.spin - whole.apply(before.spin)
        for k in bodies:
            name = self.world.bodies[k].name
            own = pose_of(values, name)
            arm = whole.apply(own.place - before.place)
            speed = pose.velocity + whole.apply(own.velocity - before.velocity) + np.cross(spin, arm)
            moved = Pose(whole * own.turn, pose.place + arm, speed, spin + whole.apply(own.spin))
            values |= moved.values(name)

    def x(self, qpos: Array, qvel: Array, world: World | None = None) -> Array:
        """(nx,): the state here; of another world with the same bodies if one is given."""
        return np.array(ca.DM(initial_state(world or self.world, self.state(qpos, qvel)))).ravel()

    def mass_matrix(self, qpos: Array) -> Array:
        """(nv, nv): here, by MuJoCo's velocities, from masses, inertias, places and armatures of the bodies here."""
        columns = [self._weighted(self.state(qpos, unit)) for unit in np.eye(self.model.nv)]
        jacobian = np.stack(columns, axis=1)
        found = jacobian.T @ jacobian
        armatures = {joint.name: float(joint.armature) for joint in self.world.joints}
        for name, j in self.joints.items():
            dof = self.model.jnt_dofadr[j]
            found[dof, dof] += armatures[name]
        return found

    def _weighted(self, values: Values) -> Array:
        """(6 bodies,): velocities such that half their square is the kinetic energy."""
        found = []
        for body in self.world.bodies:
            pose = pose_of(values, body.name)
            found.append(np.sqrt(float(body.mass)) * pose.velocity)
            found.append(root_of(tensor(body.inertia)) @ pose.turn.inv().apply(pose.spin))
        return np.concatenate(found)

    def mass_matrix_there(self, qpos: Array) -> Array:
        """(nv, nv): MuJoCo's own."""
        full = np.zeros((self.model.nv, self.model.nv))
        self.data.qpos[:] = qpos
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_fullM(self.model, self.data, full)
        return full

    def centres(self, qpos: Array) -> tuple[float, Array, float, Array]:
        """Mass [kg] and centre of mass (3,) [m] of all that moves, here and in MuJoCo."""
        values = self.state(qpos, np.zeros(self.model.nv))
        masses = np.array([float(body.mass) for body in self.world.bodies])
        here = masses @ np.array([values[f"{body.name}.position"] for body in self.world.bodies]) / masses.sum()
        moving = self.moving()
        weights = self.model.body_mass[moving]
        return float(masses.sum()), here, float(weights.sum()), weights @ self.data.xipos[moving] / weights.sum()

    def moving(self) -> Array:
        """Indices of MuJoCo's bodies that are not welded to the world."""
        return np.flatnonzero(self.model.body_weldid != 0)

    def random(self, rng: np.random.Generator, speed: float = 1.0) -> tuple[Array, Array]:
        """Coordinates and velocities of MuJoCo, within the middle of the limits."""
        model = self.model
        qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
        for j in range(model.njnt):
            q, v, kind = model.jnt_qposadr[j], model.jnt_dofadr[j], model.jnt_type[j]
            if kind == FREE:
                qpos[q + 3 : q + 7] = Rotation.random(random_state=rng).as_quat(scalar_first=True)
                qvel[v : v + 6] = speed * rng.normal(0, 1, 6)
                continue
            slides = kind == mujoco.mjtJoint.mjJNT_SLIDE
            lower, upper = model.jnt_range[j] if model.jnt_limited[j] else (qpos[q] - 0.8, qpos[q] + 0.8)
            lower, upper = max(lower, qpos[q] - 1.5), min(upper, qpos[q] + 1.5)
            qpos[q] = lower + (upper - lower) * rng.uniform(0.2, 0.8)
            qvel[v] = speed * rng.normal(0, 0.3 if slides else 1.0)
        return qpos, qvel


def matched(world: World, start: Mapping[str, Any], model: mujoco.MjModel) -> Match:
    """The two as they are compared: without what has no counterpart in free motion."""
    for j in np.flatnonzero(model.jnt_type == FREE):
        dofs = slice(model.jnt_dofadr[j], model.jnt_dofadr[j] + 6)
        model.dof_armature[dofs] = model.dof_damping[dofs] = 0
    model.opt.density = model.opt.viscosity = 0
    model.tendon_stiffness[:] = model.tendon_damping[:] = 0
    for name in SWITCHED_OFF:
        model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    return Match(world, start, model)


def unforced(world: World) -> World:
    """A world without contacts, motors, limits, dry friction, and without joints that close loops."""
    kept = tree_joints(world.joints)
    joints = tuple(
        replace(joint, motor=None, limits=Limits(), friction=0.0) for k, joint in enumerate(world.joints) if k in kept
    )
    return replace(world, pairs=(), joints=joints, couplings=(), sites=())


def moves(joint: Any) -> bool:
    """Whether a joint leaves anything free."""
    return joint.kind.name != "fixed"


def plain(name: str) -> str:
    """A name as an identifier, in small letters."""
    return re.sub(r"\W", "_", name).lower()


def orientation(quaternion: Any) -> Rotation:
    """From w x y z."""
    return Rotation.from_quat(np.array(quaternion, float), scalar_first=True)


def pose_of(values: Values, name: str) -> Pose:
    """A body's, by the names of a state."""
    fields = ("position", "velocity", "angular_velocity")
    place, velocity, spin = (np.array(values[f"{name}.{field}"], float) for field in fields)
    return Pose(orientation(values[f"{name}.orientation"]), place, velocity, spin)


def tensor(inertia: Any) -> Array:
    """(3, 3): in a body's frame, from a scalar, principal moments or itself."""
    found = np.array(inertia, float)
    return found if found.ndim == 2 else np.diag(np.broadcast_to(found, 3))


def root_of(inertia: Array) -> Array:
    """(3, 3): whose square is the tensor."""
    moments, axes = np.linalg.eigh(inertia)
    return axes * np.sqrt(np.maximum(moments, 0)) @ axes.T
