"""Robots of other people: where installed packages keep them, and each as MuJoCo reads it, without this engine.

MJCF files are read as they are. MuJoCo refuses most URDF files: here their visuals are dropped, meshes are sought below
the package, a root without a link ``world`` is set free, and inertias that MuJoCo refuses are put into the compiled
model.
"""

from __future__ import annotations

import importlib.util
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

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
"""By the name in the table."""
HELD = ("panda", "kinova", "so100", "finger_edu", "double_pendulum")
"""Those that stand on a table, whatever their files say."""
LIGHT = 1e-9
"""[kg], [kg m^2]: less than this MuJoCo does not compile."""


@dataclass(frozen=True)
class RobotModel:
    """A model in an installed package.

    Attributes:
        name: ``gymnasium/ant``.
        path: of the file.
    """

    name: str
    path: Path

    @property
    def urdf(self) -> bool:
        """Whether it is a URDF file."""
        return self.path.suffix == ".urdf"

    @property
    def base(self) -> Literal["auto", "fixed"]:
        """Arms without a link ``world`` are held."""
        return "fixed" if self.name.removeprefix("urdf/") in HELD else "auto"

    def time_step(self) -> float:
        """[s]; URDF files name none."""
        return 0.002 if self.urdf else float(mujoco.MjModel.from_xml_path(str(self.path)).opt.timestep)

    def reference(self, floor: float | None = None) -> mujoco.MjModel:
        """As MuJoCo reads it; ``floor`` puts a level plane at this height under a URDF, which brings none."""
        return (
            mended(self.path, self.base == "fixed", floor)
            if self.urdf
            else mujoco.MjModel.from_xml_path(str(self.path))
        )


def gymnasium_model(name: str) -> RobotModel:
    """One of gymnasium's."""
    return RobotModel(f"gymnasium/{name}", folder("gymnasium") / "envs" / "mujoco" / "assets" / f"{name}.xml")


def all_models() -> list[RobotModel]:
    """Those whose files are here, in the order of the table."""
    found = [gymnasium_model(name) for name in GYMNASIUM]
    suite = folder("dm_control") / "suite"
    found += [RobotModel(f"dm_control/{name}", suite / f"{name}.xml") for name in DM_CONTROL]
    data = Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
    found += [RobotModel(f"urdf/{name}", data / f"{place}.urdf") for name, place in URDF.items()]
    return [model for model in found if model.path.is_file()]


def folder(package: str) -> Path:
    """Where a package lies, without importing it; a folder that does not exist if it is not installed."""
    spec = importlib.util.find_spec(package)
    places = None if spec is None else spec.submodule_search_locations
    return Path(next(iter(places), "")) if places else Path("not installed")


def mended(path: Path, fixed: bool, floor: float | None = None) -> mujoco.MjModel:
    """A URDF file as MuJoCo's model, its fixed links as bodies of their own; its root floats unless it is held."""
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
    from xml.etree.ElementTree import ParseError, parse

    try:
        return any(link.get("name") == "world" for link in parse(path).getroot().iter("link"))
    except ParseError:
        return False


def _keep_collisions(spec: mujoco.MjSpec, place: Path) -> None:
    """Drop what is only seen, and meshes that MuJoCo cannot read or that are not there."""
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
    """Where a file that a URDF names may be: beside it or below the folders above it."""
    name = name.removeprefix("package:").lstrip("/")
    for above in (place, *place.parents):
        if (above / name).is_file():
            yield above / name


def _mend_inertia(body: mujoco.MjsBody) -> tuple[float, Array] | None:
    """Give a link one that MuJoCo takes, where it refuses the file's; then returns the file's mass and tensor."""
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
    """Put the file's numbers into a compiled model, which is not asked what it thinks of them."""
    axes, turn = np.zeros(9), np.zeros(4)
    mujoco.mju_quat2Mat(axes, model.body_iquat[body])
    frame = axes.reshape(3, 3)
    moments, principal = np.linalg.eigh(frame @ tensor @ frame.T)
    principal[:, 0] *= np.linalg.det(principal)
    mujoco.mju_mat2Quat(turn, principal.ravel())
    model.body_mass[body], model.body_inertia[body], model.body_iquat[body] = mass, moments, turn
