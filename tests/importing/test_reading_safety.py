"""No model reads a file outside of its folder, grows without end, or ends in anything but a robot or a message."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from tools.waiting import FOREVER

from symphys.importing import robot as reading_process
from symphys.importing.reading.checking import check_model
from symphys.importing.reading.folders import Folders
from symphys.importing.records import ImportOptions, ImportProblem
from symphys.importing.robot import read_source

mujoco = pytest.importorskip("mujoco")

BODY = '<body><freejoint/><geom size="0.1"/></body>'


def model(folder: Path, inside: str, name: str = "robot.xml") -> Path:
    folder.mkdir(exist_ok=True)
    file = folder / name
    file.write_text(f"<mujoco>{inside}<worldbody>{BODY}</worldbody></mujoco>", encoding="utf-8")
    return file


@pytest.fixture
def inside(tmp_path: Path) -> Path:
    """The model's folder, beside which there is a file that is none of its business."""
    (tmp_path / "secret.xml").write_text("<mujoco><option/></mujoco>", encoding="utf-8")
    (tmp_path / "secret.obj").write_text("v 0 0 0\n", encoding="utf-8")
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "link.xml").symlink_to(tmp_path / "secret.xml")
    return tmp_path / "model"


@pytest.mark.parametrize(
    "text",
    [
        '<include file="../secret.xml"/>',
        '<include file="{outside}/secret.xml"/>',
        '<include file="link.xml"/>',
        '<asset><model name="m" file="../secret.xml"/></asset>',
        '<asset><mesh name="m" file="../secret.obj"/></asset>',
        '<compiler meshdir=".."/><asset><mesh name="m" file="secret.obj"/></asset>',
        '<asset><hfield name="h" file="../secret.obj" size="1 1 1 1"/></asset>',
    ],
)
def test_files_outside_are_refused_before_mujoco_sees_the_model(
    inside: Path, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = model(inside, text.format(outside=inside.parent))
    monkeypatch.setattr(reading_process, "run", lambda *_: pytest.fail("MuJoCo was started"))
    with pytest.raises(ImportProblem, match="--assets ") as caught:
        read_source(file)
    assert str(caught.value).startswith(f"{file}: line 1: <")


def test_a_folder_that_is_allowed_may_be_read(inside: Path) -> None:
    file = model(inside, '<include file="../secret.xml"/>')
    source = read_source(file, ImportOptions(assets=(inside.parent,)))
    assert source.model.nbody == 2
    assert inside.parent / "secret.xml" in {path.resolve() for path in source.files}


def test_images_are_not_read_wherever_they_are(inside: Path) -> None:
    text = '<asset><texture name="t" type="2d" file="../gone.png"/><material name="m" texture="t"/></asset>'
    source = read_source(model(inside, text))
    assert source.model.ntex == 0
    assert [finding.what for finding in source.findings] == ["1 texture"]


@pytest.mark.parametrize("name", ["../secret.obj", "package://model/../secret.obj", "file://{outside}/secret.obj"])
def test_meshes_of_a_urdf_do_not_lead_outside(inside: Path, name: str) -> None:
    geometry = f'<collision><geometry><mesh filename="{name.format(outside=inside.parent)}"/></geometry></collision>'
    file = inside / "robot.urdf"
    file.write_text(f'<robot name="r"><link name="a">{geometry}</link></robot>', encoding="utf-8")
    with pytest.raises(ImportProblem, match=r"mesh .*--assets "):
        read_source(file)


REFUSED = {
    "not well-formed": "<mujoco><a></mujoco>",
    "DOCTYPE": '<!DOCTYPE m [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><mujoco>&b;</mujoco>',
    "nested deeper than 200": "<mujoco>" + "<body>" * 300 + "</body>" * 300 + "</mujoco>",
    '<geom> size = "nan"': '<mujoco>\n<geom size="nan"/></mujoco>',
    '<geom> size = "1 -inf"': '<mujoco><geom size="1 -inf"/></mujoco>',
    '<joint> armature = "1e400"': '<mujoco><joint armature="1e400"/></mujoco>',
    "<hfield> ncol": '<mujoco><hfield nrow="60000" ncol="60000"/></mujoco>',
    "<size> njmax": '<mujoco><size njmax="2000000000"/></mujoco>',
    "makes 1e+08 copies": '<mujoco><replicate count="10000"><replicate count="10000"/></replicate></mujoco>',
    "outermost element is <svg>": "<svg/>",
    "is empty": "  \n",
    "zero byte": "<mujoco>\0</mujoco>",
}


@pytest.mark.parametrize("why", REFUSED)
def test_texts_that_could_do_harm_are_refused(tmp_path: Path, why: str) -> None:
    file = tmp_path / "robot.xml"
    file.write_text(REFUSED[why], encoding="utf-8")
    with pytest.raises(ImportProblem) as caught:
        check_model(Folders(file))
    assert why in str(caught.value)
    assert str(caught.value).startswith(str(file))


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.xml")
    (tmp_path / "latin.xml").write_bytes(b"<mujoco>\n\xe9</mujoco>")
    cases = ((tmp_path, "folder"), (tmp_path / "no.xml", "no such file"), (tmp_path / "pipe.xml", "named pipe"))
    for path, why in (*cases, (tmp_path / "latin.xml", r"not UTF-8 text \(line 2\)")):
        with pytest.raises(ImportProblem, match=why):
            check_model(Folders(path))


def test_infinite_efforts_are_no_limits(tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    file.write_text('<robot><joint><limit effort="inf" velocity="inf"/></joint></robot>', encoding="utf-8")
    assert check_model(Folders(file)).kind == "urdf"


def test_included_files_are_checked_too(tmp_path: Path) -> None:
    file = model(tmp_path, '<include file="part.xml"/>')
    (tmp_path / "part.xml").write_text('<mujoco>\n<option timestep="nan"/></mujoco>', encoding="utf-8")
    with pytest.raises(ImportProblem, match=r"part.xml, line 2: <option> timestep"):
        check_model(Folders(file))


@pytest.mark.parametrize(
    ("code", "limit", "why"),
    [
        ("import os; os.abort()", FOREVER, "without an answer"),
        ("import time; time.sleep(100000)", 0.5, "longer than 0.5 s"),
    ],
)
def test_a_crash_or_a_hang_of_mujoco_is_a_message(
    tmp_path: Path, code: str, limit: float, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading_process, "CALL", code)
    monkeypatch.setattr(reading_process, "COMPILE_TIMEOUT", limit)
    with pytest.raises(ImportProblem, match=why):
        read_source(model(tmp_path, ""))


def test_what_mujoco_refuses_is_said_with_its_place(tmp_path: Path) -> None:
    file = model(tmp_path, '<option gravity="1"/>')
    with pytest.raises(ImportProblem, match=r"robot.xml: .*'gravity'.*line 1"):
        read_source(file)


def test_memory_that_a_model_asks_for_is_mujocos_own_affair(tmp_path: Path) -> None:
    source = read_source(model(tmp_path, '<size memory="900T"/>'))
    assert mujoco.MjData(source.model).qpos.shape == (7,)
