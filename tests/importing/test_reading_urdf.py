"""What MuJoCo loses of a URDF is recovered from its file, or named."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from tools.repeats import few

from symphys.importing.records import CompiledModel, Finding, ImportOptions, ImportProblem
from symphys.importing.robot import Imported, read_robot, read_source

mujoco = pytest.importorskip("mujoco")

INERTIAL = """<inertial><origin xyz="0 0 0.1"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0" ixz="0" iyz="0"/></inertial>"""
LINK = '<link name="{name}">{inside}</link>'
HINGE = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><axis xyz="0 1 0"/>
<origin xyz="0.2 0 0"/><limit lower="-1" upper="1" effort="{effort}" velocity="3"/>{more}</joint>"""


def link(name: str, inside: str = INERTIAL) -> str:
    return LINK.format(name=name, inside=inside)


def hinge(name: str, parent: str, child: str, effort: str = "7", more: str = "") -> str:
    return HINGE.format(name=name, parent=parent, child=child, effort=effort, more=more)


ARM = (
    link("base") + link("upper") + link("lower") + hinge("shoulder", "base", "upper") + hinge("elbow", "upper", "lower")
)
WALKER = link("base") + link("left") + link("right") + hinge("a", "base", "left") + hinge("b", "base", "right")


def source_of(folder: Path, inside: str, **options: object) -> CompiledModel:
    file = folder / "robot.urdf"
    file.write_text(f'<robot name="r">{inside}</robot>', encoding="utf-8")
    return read_source(file, ImportOptions(**options))  # type: ignore[arg-type]


def robot_of(folder: Path, inside: str) -> Imported:
    source_of(folder, inside)
    return read_robot(folder / "robot.urdf")


def said(findings: tuple[Finding, ...], about: str) -> Finding:
    (found,) = [finding for finding in findings if finding.what.startswith(about)]
    return found


def table(robot: Imported, kind: str, name: str) -> Mapping[str, object]:
    (found,) = [each for each in robot.tables[kind] if each["name"] == name]
    return found  # type: ignore[no-any-return]


@pytest.mark.slow
def test_an_arm_stands_and_a_walker_floats_unless_told_otherwise(tmp_path: Path) -> None:
    """MuJoCo fuses the roots of all of them to the world."""
    cases = [(ARM, "auto", 2), (WALKER, "auto", 8), (ARM, "free", 8), (WALKER, "fixed", 2)]
    for inside, base, dofs in cases:
        source = source_of(tmp_path, inside, base=base)
        assert source.model.nv == dofs
        word = "floats" if dofs == 8 else "fixed to the world"
        assert word in said(source.findings, "root link base").how


def test_a_link_called_world_holds_the_root(tmp_path: Path) -> None:
    held = '<joint name="w" type="fixed"><parent link="world"/><child link="base"/></joint>'
    source = source_of(tmp_path, link("world", "") + held + WALKER)
    assert source.model.nv == 2
    assert "'world'" in said(source.findings, "root link base").how


def test_prefixes_need_not_be_bound(tmp_path: Path) -> None:
    """Files of xacro and of simulators have such, and MuJoCo takes them."""
    source = source_of(tmp_path, ARM + '<sensor:camera name="eye"><xacro:gain value="1"/></sensor:camera>')
    assert source.motors.keys() == {"shoulder", "elbow"}


@pytest.mark.slow
def test_efforts_become_motors(tmp_path: Path) -> None:
    """Without transmissions of all joints, else of those that have one; speeds are named."""
    robot = robot_of(tmp_path, ARM)
    for name in ("shoulder", "elbow"):
        assert table(robot, "joint", name)["motor"] == {"affine": {"command_range": [-7.0, 7.0]}}
    assert "3 to 3" in said(robot.findings, "2 velocity limits").amount
    drive = '<transmission name="t"><joint name="elbow"/><actuator name="m"/></transmission>'
    robot = robot_of(tmp_path, ARM + drive)
    assert "motor" not in table(robot, "joint", "shoulder")
    assert "motor" in table(robot, "joint", "elbow")
    assert "transmissions" in said(robot.findings, "1 motor").how


def test_a_transmission_without_effort_or_joint_is_named(tmp_path: Path) -> None:
    drives = "".join(f'<transmission name="{n}"><joint name="{n}"/></transmission>' for n in ("elbow", "ghost"))
    robot = robot_of(tmp_path, ARM.replace('effort="7"', 'effort="0"') + drives)
    assert said(robot.findings, "motor of elbow").kind == "left out"
    assert said(robot.findings, "transmission of ghost").kind == "left out"


def test_mimic_and_dynamics_are_taken_over(tmp_path: Path) -> None:
    more = '<mimic joint="shoulder" multiplier="2" offset="0.1"/><dynamics damping="0.3" friction="0.2"/>'
    inside = ARM.replace(hinge("elbow", "upper", "lower"), hinge("elbow", "upper", "lower", more=more))
    robot = robot_of(tmp_path, inside)
    (coupling,) = robot.tables["coupling"]
    assert coupling["joints"] == ["elbow", "shoulder"]
    assert coupling["polynomial"][:2] == [0.1, 2.0]
    elbow = table(robot, "joint", "elbow")
    assert elbow["spring"] == {"damping": 0.3}
    assert elbow["friction"] == 0.2


@pytest.mark.slow
def test_masses_are_those_of_the_file(tmp_path: Path) -> None:
    """A link without <inertial> has none, whatever its shapes; an inertia that MuJoCo refuses is kept."""
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    fixed = '<joint name="f{0}" type="fixed"><parent link="base"/><child link="{0}"/></joint>'
    thin = INERTIAL.replace('ixx="0.1"', 'ixx="0"').replace('iyy="0.2"', 'iyy="0"').replace('izz="0.15"', 'izz="0"')
    extra = link("pad", ball) + fixed.format("pad") + link("dot", thin) + fixed.format("dot")
    robot = robot_of(tmp_path, WALKER + extra)
    assert table(robot, "body", "base")["mass"] == pytest.approx(4.0, rel=1e-14)
    assert np.allclose(table(robot, "body", "base")["inertia"], [0.1, 0.2, 0.15], atol=1e-14)  # both at one place
    assert said(robot.findings, "mass of pad").kind == "recovered"
    assert said(robot.findings, "inertia of dot").kind == "recovered"


def test_a_negative_mass_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ImportProblem, match='<link name="base"> mass: '):
        source_of(tmp_path, ARM.replace('value="2"', 'value="-2"', 1))


@few(
    ("old", "new"),
    [('value="2"', 'value="1e308"'), ('ixz="0"', 'ixz="1e308"'), ('xyz="0 0 0.1"', 'xyz="0 0 1e308"')],
    1,
)
def test_masses_inertias_and_centres_beyond_what_can_be_computed_are_refused(
    tmp_path: Path, old: str, new: str
) -> None:
    """Also where MuJoCo refuses the numbers and those of the file are taken; links without mass are such."""
    for mass in ("0.1", "0"):
        text = ARM.replace('ixx="0.1"', f'ixx="{mass}"', 1)
        assert old in text
        with pytest.raises(ImportProblem, match=r'<link name="base"> inertial: mass|infinite or beyond 1e\+12'):
            source_of(tmp_path, text.replace(old, new, 1))


@pytest.mark.parametrize("first", [0.1, 0.0])
def test_inertias_are_turned_with_their_frames(tmp_path: Path, first: float) -> None:
    """By a quarter about x: what was about y is about z; also where MuJoCo refuses the numbers."""
    turned = INERTIAL.replace('xyz="0 0 0.1"', 'xyz="0 0 0.1" rpy="1.5707963267948966 0 0"')
    turned = turned.replace('ixx="0.1"', f'ixx="{first}"')
    source = source_of(tmp_path, link("base", turned) + WALKER.removeprefix(link("base")))
    if first:
        own = source.model.body("base")
        assert np.allclose(own.ipos, [0, 0, 0.1])
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, own.iquat)
        turn.shape = 3, 3
        assert np.allclose(turn @ np.diag(own.inertia) @ turn.T, np.diag([0.1, 0.15, 0.2]), atol=1e-12)
    else:
        assert source.inertials["base"].mass == 2
        assert np.allclose(source.inertials["base"].centre, [0, 0, 0.1])
        assert np.allclose(source.inertials["base"].inertia, np.diag([0, 0.15, 0.2]), atol=1e-12)


TETRAHEDRON = """v 0 0 0
v 0.1 0 0
v 0 0.1 0
v 0 0 0.1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


def mesh(name: str) -> str:
    return f'<collision><geometry><mesh filename="{name}"/></geometry></collision>'


def test_meshes_of_packages_are_found_above_the_model(tmp_path: Path) -> None:
    """In all spellings; in the folder that is called like the package, or that has the rest of the path."""
    folder = tmp_path / "bot_description" / "urdf"
    (tmp_path / "bot_description" / "meshes").mkdir(parents=True)
    folder.mkdir()
    (tmp_path / "bot_description" / "meshes" / "a.obj").write_text(TETRAHEDRON, encoding="utf-8")
    for spelling in ("package://bot_description/", "package:///bot_description/", "package://other/bot_description/"):
        source = source_of(folder, WALKER.replace(INERTIAL, INERTIAL + mesh(f"{spelling}meshes/a.obj"), 1))
        assert source.model.nmesh == 1
        assert tmp_path / "bot_description" / "meshes" / "a.obj" in source.files


def test_meshes_that_cannot_be_read_are_left_out_by_name(tmp_path: Path) -> None:
    (tmp_path / "ascii.stl").write_text("solid a\nfacet normal 0 0 1\nendsolid a\n", encoding="utf-8")
    (tmp_path / "hull.dae").write_text("<COLLADA/>", encoding="utf-8")
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    names = ("ascii.stl", "hull.dae", "flat.obj", "package://nowhere/gone.stl")
    source = source_of(tmp_path, WALKER.replace(INERTIAL, INERTIAL + "".join(map(mesh, names)), 1))
    assert source.model.nmesh == 0
    for name, why in (("ascii", "stl"), ("hull", "no .dae"), ("flat", "cannot read it"), ("gone", "no such file")):
        found = said(source.findings, f"mesh {name}")
        assert found.kind == "left out"
        assert why in found.how
