"""Broken models become a robot or a message; benchmarks/mutated_robots.py tries thousands."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from mutated_robots import CHANGES, mutated

from symphys.errors import SymphysError
from symphys.importing.findings import Finding
from symphys.importing.robot import read_robot

pytest.importorskip("mujoco")

MODELS = {
    "robot.xml": b"""<mujoco model="m"><compiler angle="radian"/><default><geom density="900"/></default>
<asset><mesh name="t" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody>
<geom name="floor" type="plane" size="1 1 1"/>
<body name="a" pos="0 0 1"><freejoint/><geom name="g" type="mesh" mesh="t"/><site name="s"/>
<body name="b" pos="0.2 0 0"><joint name="j" axis="0 1 0" range="-1 1" limited="true" armature="0.1"/>
<geom type="capsule" size="0.05 0.2"/></body></body></worldbody><actuator><position joint="j" kp="4"/></actuator>
<sensor><jointpos joint="j"/></sensor><keyframe><key name="k" qpos="0 0 2 1 0 0 0 0.5"/></keyframe></mujoco>""",
    "robot.urdf": b"""<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0"
ixz="0" iyz="0"/></inertial><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<link name="b"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><origin xyz="1 0 0" rpy="0 0 1"/><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="3" velocity="2"/></joint></robot>""",
}
CASES = 6


@pytest.mark.parametrize("name", MODELS)
def test_a_broken_model_is_a_robot_or_a_message(tmp_path: Path, name: str) -> None:
    dice, seen = random.Random(7), set[bool]()
    for text in (MODELS[name], *(mutated(MODELS[name], dice) for _ in range(CASES))):
        file = tmp_path / name
        file.write_bytes(text)
        try:
            robot = read_robot(file)
            assert all(isinstance(finding, Finding) for finding in robot.findings)
            seen.add(True)
        except SymphysError as error:
            assert str(error).startswith(str(file))
            seen.add(False)
    assert seen == {True, False}


@pytest.mark.parametrize("change", CHANGES)
def test_every_change_changes_something(change: object) -> None:
    """Else the thousands would be copies of what works."""
    dice = random.Random(1)
    assert callable(change)
    assert any(change(MODELS["robot.urdf"], dice) != MODELS["robot.urdf"] for _ in range(3))
