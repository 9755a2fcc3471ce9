"""Models of MuJoCo that are read, written and read again are the same, and MuJoCo finds the same masses in them."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import first
from tools.same_worlds import compared, differences

from symphys.export import MjcfModel, problem_model
from symphys.importing.records import ImportOptions
from symphys.importing.robot import read_robot
from symphys.problem import Problem, problem_of_tables

mujoco = pytest.importorskip("mujoco")
TIME = {"simulation": {"duration": 0.1, "dt": 0.01}}
WALKER = """
<mujoco>
  <option gravity="0 0 -3.7" density="0"/>
  <default><geom density="500" friction="0.8 0.01 0.002"/><joint damping="0.1"/></default>
  <asset>
    <hfield name="hills" nrow="3" ncol="4" size="4 3 0.5 1" elevation="0 0.1 0.2 0.3 0.4 1 0.2 0 0 0.1 0 0"/>
    <mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1  0.1 0.1 0"/>
  </asset>
  <worldbody>
    <geom name="hills" type="hfield" hfield="hills" pos="1 2 -3" contype="2" conaffinity="2"/>
    <geom name="wall" type="plane" size="1 1 1" pos="9 0 0" zaxis="-1 0 0"/>
    <geom name="post" type="capsule" size="0.1 1" pos="-5 0 0" euler="30 0 10"/>
    <site name="home" pos="1 2 3" euler="0 40 0"/>
    <body name="trunk" pos="0 0 0.7" euler="0 10 0">
      <freejoint/>
      <geom name="hull" type="box" size="0.2 0.1 0.05" pos="0.05 0 0" euler="10 0 20"/>
      <geom type="ellipsoid" size="0.1 0.05 0.04" pos="0 0 0.1" condim="4"/>
      <site name="imu" pos="0.1 0 0" euler="0 0 30"/>
      <body name="upper" pos="0.1 0.1 -0.05" euler="0 0 5">
        <joint name="hip_x" axis="1 0 0" range="-50 60" armature="0.01"/>
        <joint name="hip_y" axis="0 1 0.2" pos="0 0 0.02" frictionloss="0.3" ref="10" stiffness="4" springref="20"/>
        <joint name="hip_z" type="slide" axis="0 0 1" limited="true" range="-0.1 0.1"/>
        <geom type="capsule" fromto="0 0 0 0.02 0 -0.3" size="0.03"/>
        <body name="lower" pos="0 0 -0.35">
          <joint name="knee" axis="0 1 0" range="-100 0" damping="0.5"/>
          <geom type="cylinder" size="0.03 0.1" pos="0 0 -0.15" condim="6"/>
          <site name="toe" pos="0 0 -0.3"/>
        </body>
      </body>
      <body name="arm" pos="0.1 -0.15 0">
        <joint name="shoulder" type="ball" damping="0"/>
        <geom type="mesh" mesh="wedge" pos="0 0 -0.05"/>
        <body name="hand" pos="0.2 0 0.1"><joint name="wrist" axis="0 0 1"/><geom type="sphere" size="0.04"/></body>
      </body>
      <body name="tail" pos="-0.3 0 0">
        <joint name="tail" axis="0 0 1" damping="0.05"/>
        <geom type="capsule" fromto="0 0 0 -0.3 0 0" size="0.02"/>
        <body name="tip" pos="-0.35 0 0">
          <joint name="tip" axis="0 1 0"/>
          <geom type="sphere" size="0.03" contype="3"/>
        </body>
      </body>
    </body>
    <body name="box" pos="3 0 1"><freejoint/><geom name="cargo" type="box" size="0.2 0.3 0.1" friction="0.4"/></body>
  </worldbody>
  <contact><exclude body1="trunk" body2="lower"/><pair geom1="cargo" geom2="wall" condim="1"/></contact>
  <equality>
    <joint joint1="tip" joint2="tail" polycoef="0 0.5 0.1 0 0"/>
    <connect body1="hand" body2="trunk" anchor="0.02 0 0"/>
  </equality>
  <actuator>
    <motor name="hip" joint="hip_x" gear="40" ctrlrange="-1 1"/>
    <position joint="knee" kp="30" kv="2" ctrlrange="-1.5 0" forcerange="-20 25"/>
    <general joint="hip_z" gainprm="5" biastype="affine" biasprm="0.5 -3 -1"/>
    <motor name="jet" site="imu" gear="0 1 2 0.1 0 0.3" ctrlrange="-1 4"/>
  </actuator>
  <sensor>
    <jointpos joint="knee"/><jointvel joint="hip_x"/><framepos objtype="site" objname="toe"/>
    <gyro name="spin" site="toe_"/><actuatorfrc actuator="hip"/>
  </sensor>
</mujoco>
""".replace('<site name="toe" pos="0 0 -0.3"/>', '<site name="toe" pos="0 0 -0.3"/><site name="toe_"/>')
"""Something of everything that is taken over without approximation."""


def read(path: Path, keyframe: str | None = None) -> tuple[dict[str, Any], Problem]:
    tables = read_robot(path, ImportOptions(keyframe=keyframe)).tables
    return tables, problem_of_tables({**TIME, **tables}, path.stem)


def written(problem: Problem, folder: Path) -> tuple[MjcfModel, Path]:
    made, path = problem_model(problem), folder / f"{problem.name}.xml"
    path.write_text(made.text, encoding="utf-8")
    return made, path


def plain(value: Any) -> Any:
    """Tables whose lists of tables are by place, and whose lists of numbers are arrays."""
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list):
        if value and isinstance(value[0], dict):
            return {str(k): plain(each) for k, each in enumerate(value)}
        return value if any(isinstance(each, str) for each in value) else np.array(value, float)
    return str(value) if isinstance(value, bool) else value


def without_filters(tables: dict[str, Any]) -> dict[str, Any]:
    """Without what says who may touch whom, which may be said in several ways; worlds are compared for that."""
    named = ("group", "collides_with")
    bodies = [{key: value for key, value in body.items() if key not in named} for body in tables["body"]]
    return {key: value for key, value in tables.items() if key not in ("pair", "contact")} | {"body": bodies}


def masses(model: Any, pose: list[Any], offsets: dict[int, Any]) -> Any:
    """(nv, nv) mass matrix in a pose, by the velocities of floating bodies that lie so much off (3,) [m]."""
    data = mujoco.MjData(model)
    change = np.eye(model.nv)
    for k in range(model.njnt):
        at, dof = model.jnt_qposadr[k], model.jnt_dofadr[k]
        if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_FREE:
            place, turn = pose[k][:3], pose[k][3:]
            axes = np.zeros(9)
            mujoco.mju_quat2Mat(axes, turn)
            arm = axes.reshape(3, 3) @ offsets.get(k, np.zeros(3))
            data.qpos[at : at + 7] = [*(place + arm), *turn]
            # the velocity of this frame by that of the other one, and the spin in the body's axes
            change[dof : dof + 3, dof + 3 : dof + 6] = np.cross(axes.reshape(3, 3).T, arm).T
        elif model.jnt_type[k] == mujoco.mjtJoint.mjJNT_BALL:
            data.qpos[at : at + 4] = pose[k]
        else:
            data.qpos[at] = model.qpos0[at] + pose[k]
    mujoco.mj_forward(model, data)
    found = np.zeros((model.nv, model.nv))
    for row, unit in zip(found, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return change.T @ found @ change


def poses(model: Any, rng: Any) -> list[Any]:
    """A random one: the coordinates of every joint, from the reference pose."""
    found = list[Any]()
    for kind in model.jnt_type:
        turn = rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            found.append(np.array([*rng.normal(size=3), *turn]))
        else:
            found.append(turn if kind == mujoco.mjtJoint.mjJNT_BALL else rng.uniform(-1, 1))
    return found


def check(path: Path, folder: Path) -> MjcfModel:
    """Equal tables, equal worlds, and mass matrices that agree in random poses."""
    tables, problem = read(path)
    made, new = written(problem, folder)
    again, repeated = read(new)
    assert list(compared("", plain(without_filters(tables)), plain(without_filters(again)), 1e-9)) == []
    assert differences((problem.world(), problem.initial), (repeated.world(), repeated.initial)) == []
    model, other = (mujoco.MjModel.from_xml_path(str(each)) for each in (path, new))
    rng = np.random.default_rng(0)
    offsets = {k: model.body_ipos[body] for k, body in enumerate(model.jnt_bodyid)}
    for _ in range(3):
        pose = poses(model, rng)
        assert masses(other, pose, offsets) == pytest.approx(masses(model, pose, {}), abs=1e-11)
    return made


@pytest.mark.slow
def test_a_model_of_everything(tmp_path: Path) -> None:
    path = tmp_path / "original.xml"
    path.write_text(WALKER, encoding="utf-8")
    (tmp_path / "new").mkdir()
    made = check(path, tmp_path / "new")
    assert not [each for each in made.departures if each.kind == "left out"]


LEG = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="trunk" pos="0 0 1"><freejoint/><geom type="box" size="0.2 0.1 0.1" pos="0.1 0 0"/>
      <body name="leg" pos="0 0 -0.2">
        <joint name="hip" axis="1 0 0"/><joint name="swing" axis="0 1 0" ref="0.2"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03"/>
      </body>
    </body>
  </worldbody>
  <keyframe><key name="home" qpos="1 2 3 0.6 0 0.8 0 0.5 -0.3"/></keyframe>
</mujoco>
"""


def test_a_model_that_begins_at_a_keyframe_comes_back_at_its_own(tmp_path: Path) -> None:
    """Places and coordinates; bodies of the written model lie at coordinates 0."""
    path = tmp_path / "leg.xml"
    path.write_text(LEG, encoding="utf-8")
    _, problem = read(path, "home")
    _, path = written(problem, tmp_path)
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.qpos0[7:] == pytest.approx([0, 0]) and model.key_qpos[0][7:] == pytest.approx([0.5, -0.5])
    _, again = read(path, "start")
    assert differences((problem.world(), problem.initial), (again.world(), again.initial)) == []


@pytest.mark.slow
@pytest.mark.skipif(find_spec("gymnasium") is None, reason="gymnasium is not installed")
@first("name", ["ant", "hopper", "half_cheetah"])
def test_models_of_gymnasium(name: str, tmp_path: Path) -> None:
    spec = find_spec("gymnasium")
    assert spec is not None and spec.submodule_search_locations
    folder = Path(spec.submodule_search_locations[0]) / "envs" / "mujoco" / "assets"
    if not (folder / f"{name}.xml").is_file():
        pytest.skip("this gymnasium has no models")
    check(folder / f"{name}.xml", tmp_path)
