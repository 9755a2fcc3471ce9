"""Robots of other people for both engines: where packages keep them, their import, and the same state in both.

MuJoCo reads MJCF files as they are. It refuses most URDF files: here their visuals are dropped, meshes are sought below
the package, a root without a link ``world`` is set free, and inertias that MuJoCo refuses are put into the compiled
model.
"""

from __future__ import annotations

import importlib.util
import re
import sysconfig
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal
from xml.etree.ElementTree import ParseError, parse

import casadi as ca
import mujoco
import numpy as np
from robots import Pose, Values, state_of
from scipy.spatial.transform import Rotation

import symphys
from symphys.model.joints import kinematic_trees, tree_joints
from symphys.model.joints.joint import Limits
from symphys.model.shapes import Plane
from symphys.model.state_layout import initial_state
from symphys.model.world import World
from symphys.problem import Problem
from symphys.problem.robot_alone import SUPPORTS
from symphys.types import Array

GYMNASIUM = (
    *("ant", "half_cheetah", "hopper", "walker2d_v5", "humanoid", "humanoidstandup", "inverted_pendulum"),
    *("inverted_double_pendulum", "reacher", "pusher_v5", "swimmer"),
)
DM_CONTROL = (
    *("acrobot", "ball_in_cup", "cartpole", "cheetah", "dog", "finger", "fish", "hopper", "humanoid", "humanoid_CMU"),
    *("manipulator", "pendulum", "point_mass", "quadruped", "reacher", "stacker", "swimmer", "walker"),
)
URDF = {
    "solo": "solo_description/robots/solo",
    "solo12": "solo_description/robots/solo12",
    "anymal_b": "anymal_b_simple_description/robots/anymal",
    "anymal_c": "anymal_c_simple_description/urdf/anymal",
    "a1": "a1_description/urdf/a1",
    "go1": "go1_description/urdf/go1",
    "go2": "go2_description/urdf/go2",
    "b1": "b1_description/urdf/b1",
    "hyq": "hyq_description/robots/hyq_no_sensors",
    "laikago": "laikago_description/urdf/laikago",
    "quadruped": "quadruped_description/urdf/quadruped",
    "bolt": "bolt_description/robots/bolt",
    "g1": "g1_description/urdf/g1_29dof_rev_1_0",
    "talos": "talos_data/robots/talos_reduced",
    "simple_humanoid": "simple_humanoid_description/urdf/simple_humanoid_classical",
    "human": "human_description/robots/human",
    "panda": "panda_description/urdf/panda_collision",
    "ur5": "ur_description/urdf/ur5_robot",
    "ur10": "ur_description/urdf/ur10_robot",
    "xarm7": "xarm_description/urdf/xarm7",
    "z1": "z1_description/urdf/z1",
    "kinova": "kinova_description/robots/kinova",
    "so100": "so_arm_description/urdf/so100",
    "finger_edu": "finger_edu_description/robots/finger_edu",
    "double_pendulum": "double_pendulum_description/urdf/double_pendulum",
    "tiago": "tiago_description/robots/tiago_no_hand",
    "iris": "iris_description/robots/iris",
}
"""Paths by name."""
HELD = ("panda", "kinova", "so100", "finger_edu", "double_pendulum")
"""Robots whose base is fixed, whatever their files say."""
LIGHT = 1e-9
"""Least mass [kg] and inertia [kg m^2] that MuJoCo compiles."""


@dataclass(frozen=True)
class RobotModel:
    """A model in an installed package.

    Attributes:
        name: ``gymnasium/ant``.
        path: its file.
    """

    name: str
    path: Path

    @property
    def urdf(self) -> bool:
        """Whether it is a URDF file."""
        return self.path.suffix == ".urdf"

    @property
    def base(self) -> Literal["auto", "fixed"]:
        """Return how the importer holds the base: arms without a link ``world`` are fixed."""
        return "fixed" if self.name.removeprefix("urdf/") in HELD else "auto"

    def time_step(self) -> float:
        """Return the time step of the file [s]; URDF files name none."""
        return 0.002 if self.urdf else float(mujoco.MjModel.from_xml_path(str(self.path)).opt.timestep)

    def reference(self, floor: float | None = None) -> mujoco.MjModel:
        """Return MuJoCo's model; ``floor`` puts a level plane at this height under a URDF, which brings none."""
        return (
            mended(self.path, self.base == "fixed", floor)
            if self.urdf
            else mujoco.MjModel.from_xml_path(str(self.path))
        )


def gymnasium_model(name: str) -> RobotModel:
    """Return one of gymnasium's models."""
    return RobotModel(f"gymnasium/{name}", folder("gymnasium") / "envs" / "mujoco" / "assets" / f"{name}.xml")


def all_models() -> list[RobotModel]:
    """Return the models whose files are installed, in the order of the table."""
    found = [gymnasium_model(name) for name in GYMNASIUM]
    suite = folder("dm_control") / "suite"
    found += [RobotModel(f"dm_control/{name}", suite / f"{name}.xml") for name in DM_CONTROL]
    data = Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
    found += [RobotModel(f"urdf/{name}", data / f"{place}.urdf") for name, place in URDF.items()]
    return [model for model in found if model.path.is_file()]


def folder(package: str) -> Path:
    """Return the folder of a package without importing it; one that does not exist if it is not installed."""
    spec = importlib.util.find_spec(package)
    places = None if spec is None else spec.submodule_search_locations
    return Path(next(iter(places), "")) if places else Path("not installed")


def mended(path: Path, fixed: bool, floor: float | None = None) -> mujoco.MjModel:
    """Return a URDF file as MuJoCo's model, its fixed links as bodies of their own; its root floats unless held."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.fusestatic = 0
    spec.meshdir = ""
    _keep_collisions(spec, path.parent)
    true = {body.name: found for body in spec.bodies[1:] if (found := _mend_inertia(body)) is not None}
    if not fixed and not _anchored(path):
        for root in spec.worldbody.bodies:
            if not len(root.joints):
                root.add_freejoint()
    if floor is not None:
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50, 50, 1], pos=[0, 0, floor])
    model = spec.compile()
    for name, (mass, tensor) in true.items():
        _give_back(model, model.body(name).id, mass, tensor)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _anchored(path: Path) -> bool:
    """Whether a URDF has a link ``world``, which MuJoCo takes for its own."""
    try:
        return any(link.get("name") == "world" for link in parse(path).getroot().iter("link"))
    except ParseError:
        return False


def _keep_collisions(spec: mujoco.MjSpec, place: Path) -> None:
    """Drop visuals, and meshes that MuJoCo cannot read or that are missing."""
    for geom in [geom for geom in spec.geoms if not (geom.contype or geom.conaffinity)]:
        spec.delete(geom)
    for mesh in list(spec.meshes):
        users = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        file = next(_places(mesh.file, place), None)
        if users and file is not None and file.suffix.lower() != ".dae":
            mesh.file = str(file)
            continue
        for geom in users:
            spec.delete(geom)
        spec.delete(mesh)


def _places(name: str, place: Path) -> Iterator[Path]:
    """Yield where a file that a URDF names may be: beside it or below the folders above it."""
    name = name.removeprefix("package:").lstrip("/")
    for above in (place, *place.parents):
        if (above / name).is_file():
            yield above / name


def _mend_inertia(body: mujoco.MjsBody) -> tuple[float, Array] | None:
    """Give a link an inertia that MuJoCo accepts; return the file's mass and tensor where it refuses them."""
    full = np.array(body.fullinertia)
    xx, yy, zz, xy, xz, yz = full
    tensor = np.diag(body.inertia) if np.isnan(full[0]) else np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    least, middle, most = np.linalg.eigvalsh(tensor)
    if body.explicitinertial and body.mass >= LIGHT and least > LIGHT**2 and least + middle >= most:
        return None
    mass, tensor = (body.mass, tensor) if body.explicitinertial else (0.0, np.zeros((3, 3)))
    body.explicitinertial, body.mass = True, max(mass, LIGHT)
    body.fullinertia, body.inertia = [np.nan, 0, 0, 0, 0, 0], [LIGHT] * 3
    return mass, tensor


def _give_back(model: mujoco.MjModel, body: int, mass: float, tensor: Array) -> None:
    """Put the file's numbers into a compiled model."""
    axes, turn = np.zeros(9), np.zeros(4)
    mujoco.mju_quat2Mat(axes, model.body_iquat[body])
    frame = axes.reshape(3, 3)
    moments, principal = np.linalg.eigh(frame @ tensor @ frame.T)
    principal[:, 0] *= np.linalg.det(principal)
    mujoco.mju_mat2Quat(turn, principal.ravel())
    model.body_mass[body], model.body_inertia[body], model.body_iquat[body] = mass, moments, turn


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
        """Return data of the model."""
        return mujoco.MjData(self.model)

    @cached_property
    def joints(self) -> dict[str, int]:
        """Return MuJoCo's joint of each joint here that has coordinates, by name."""
        names = {plain(self.model.joint(j).name): j for j in range(self.model.njnt)}
        found = {
            joint.name: names.get(plain(joint.name), -1) for joint in self.world.joints if joint.kind.name != "fixed"
        }
        missing = [name for name, j in found.items() if j < 0]
        rest = [j for j in range(self.model.njnt) if self.model.jnt_type[j] != FREE and j not in found.values()]
        if len(missing) != len(rest):
            there = [self.model.joint(j).name for j in rest]
            raise Unmatched(f"joints here that MuJoCo has not: {missing}; MuJoCo's that are not here: {there}")
        return found | dict(zip(missing, rest, strict=True))

    @cached_property
    def bodies(self) -> dict[str, int]:
        """Return MuJoCo's body of each body here, as far as one has its name."""
        names = {plain(self.model.body(b).name): b for b in range(1, self.model.nbody)}
        return {body.name: names[plain(body.name)] for body in self.world.bodies if plain(body.name) in names}

    @cached_property
    def trees(self) -> list[tuple[int, ...]]:
        """Return the bodies of each kinematic tree here; a body without joints is a tree."""
        found = [tree.bodies for tree in kinematic_trees(self.world.joints)]
        held = {body for bodies in found for body in bodies}
        return found + [(k,) for k in range(len(self.world.bodies)) if k not in held]

    @cached_property
    def roots(self) -> list[Root]:
        """Return a root for each tree that floats."""
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
        """Return poses and velocities here, by name, from MuJoCo's coordinates and velocities."""
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
        """Return the state (nx,) here, or of another world with the same bodies."""
        return np.array(ca.DM(initial_state(world or self.world, self.state(qpos, qvel)))).ravel()

    def mass_matrix(self, qpos: Array) -> Array:
        """Return the mass matrix (nv, nv) of the bodies here, by MuJoCo's velocities."""
        columns = [self._weighted(self.state(qpos, unit)) for unit in np.eye(self.model.nv)]
        jacobian = np.stack(columns, axis=1)
        found = jacobian.T @ jacobian
        armatures = {joint.name: float(joint.armature) for joint in self.world.joints}
        for name, j in self.joints.items():
            dof = self.model.jnt_dofadr[j]
            found[dof, dof] += armatures[name]
        return found

    def _weighted(self, values: Values) -> Array:
        """Return velocities (6 bodies,) such that half their square is the kinetic energy."""
        found = []
        for body in self.world.bodies:
            pose = pose_of(values, body.name)
            found.append(np.sqrt(float(body.mass)) * pose.velocity)
            found.append(root_of(tensor(body.inertia)) @ pose.turn.inv().apply(pose.spin))
        return np.concatenate(found)

    def mass_matrix_there(self, qpos: Array) -> Array:
        """Return MuJoCo's mass matrix (nv, nv)."""
        full = np.zeros((self.model.nv, self.model.nv))
        self.data.qpos[:] = qpos
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_fullM(self.model, self.data, full)
        return full

    def centres(self, qpos: Array) -> tuple[float, Array, float, Array]:
        """Return mass [kg] and centre of mass (3,) [m] of all that moves, here and in MuJoCo."""
        values = self.state(qpos, np.zeros(self.model.nv))
        masses = np.array([float(body.mass) for body in self.world.bodies])
        here = masses @ np.array([values[f"{body.name}.position"] for body in self.world.bodies]) / masses.sum()
        moving = self.moving()
        weights = self.model.body_mass[moving]
        return float(masses.sum()), here, float(weights.sum()), weights @ self.data.xipos[moving] / weights.sum()

    def moving(self) -> Array:
        """Return the indices of MuJoCo's bodies that are not welded to the world."""
        return np.flatnonzero(self.model.body_weldid != 0)

    def random(self, rng: np.random.Generator, speed: float = 1.0) -> tuple[Array, Array]:
        """Return random coordinates and velocities of MuJoCo, within the middle of the limits."""
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
    """Match a world with MuJoCo's model, in which what has no counterpart in free motion is switched off."""
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
    """Return a world without contacts, motors, limits, dry friction and joints that close loops."""
    kept = tree_joints(world.joints)
    joints = tuple(
        replace(joint, motor=None, limits=Limits(), friction=0.0) for k, joint in enumerate(world.joints) if k in kept
    )
    return replace(world, pairs=(), joints=joints, couplings=(), sites=())


def plain(name: str) -> str:
    """Return a name as an identifier in small letters."""
    return re.sub(r"\W", "_", name).lower()


def orientation(quaternion: Any) -> Rotation:
    """Return a rotation from w x y z."""
    return Rotation.from_quat(np.array(quaternion, float), scalar_first=True)


def pose_of(values: Values, name: str) -> Pose:
    """Return the pose of a body from the names of a state."""
    fields = ("position", "velocity", "angular_velocity")
    place, velocity, spin = (np.array(values[f"{name}.{field}"], float) for field in fields)
    return Pose(orientation(values[f"{name}.orientation"]), place, velocity, spin)


def tensor(inertia: Any) -> Array:
    """Return the inertia (3, 3) in a body's frame from a scalar, principal moments or a tensor."""
    found = np.array(inertia, float)
    return found if found.ndim == 2 else np.diag(np.broadcast_to(found, 3))


def root_of(inertia: Array) -> Array:
    """Return the square root (3, 3) of a tensor."""
    moments, axes = np.linalg.eigh(inertia)
    return axes * np.sqrt(np.maximum(moments, 0)) @ axes.T


@dataclass(frozen=True)
class Imported:
    """A model after import.

    Attributes:
        problem: about a second of it, without commands, on the ground unless the model brings one.
        placed: (3,) and (4,) where its bodies are at coordinates 0, by name.
        starts: coordinates at which joints begin, by name.
        findings: what became of its parts.
        floor: height of the ground that was put under it [m]; None: the model brings its own.
    """

    problem: Problem
    placed: Mapping[str, Any]
    starts: Mapping[str, float]
    findings: Sequence[Any]
    floor: float | None


def imported(model: RobotModel, self_collision: bool = True) -> Imported:
    """Import a model at the time step of its file; steps are not split at impacts."""
    robot = symphys.load_robot(model.path, self_collision=self_collision, base=model.base)
    dt = model.time_step()
    problem = robot.problem(dt * round(1 / dt), dt).set("simulation.cuts", 0)
    placed = {
        f"{body['name']}.{field}": body[field]
        for body in robot.tables["body"]
        for field in ("position", "orientation")
        if field in body
    }
    starts = {joint["name"]: joint["start"] for joint in robot.tables.get("joint", ()) if "start" in joint}
    own = any(key in robot.tables for key in SUPPORTS)
    ground = [each for each in problem.world().statics if isinstance(each, Plane)]
    floor = None if own or not ground else float(ground[0].offset)
    return Imported(problem, placed, starts, robot.findings, floor)


def begin(match: Match, robot: Imported) -> Array:
    """Return MuJoCo's coordinates (nq,) where the problem begins."""
    qpos = match.model.qpos0.copy()
    for name, value in robot.starts.items():
        if name in match.joints:
            qpos[match.model.jnt_qposadr[match.joints[name]]] += value
    here = match.state(match.model.qpos0, np.zeros(match.model.nv))
    for root in match.roots:
        name = f"{match.world.bodies[root.body].name}.position"
        j = match.model.body_jntadr[root.there]
        assert match.model.jnt_type[j] == FREE
        at = match.model.jnt_qposadr[j]
        qpos[at : at + 3] += np.array(robot.placed[name]) - here[name]
    return qpos


def grounded(model: RobotModel, robot: Imported) -> mujoco.MjModel:
    """Return MuJoCo's model with all that acts, on the same ground."""
    return model.reference(robot.floor)
