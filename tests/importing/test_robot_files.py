"""A model as text, as an included file, as an object and on the command line."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import symphys
from symphys.cli import main
from symphys.errors import ProblemError
from symphys.importing.records import Finding, ImportProblem
from symphys.importing.robot import Imported, read_robot
from symphys.importing.writing import number, robot_text

pytest.importorskip("mujoco")

PENDULUM = """<mujoco model="a clock"><worldbody>
<body name="rod" pos="0 0 1"><joint name="pivot" axis="0 1 0" range="-90 90" damping="0.1"/>
<geom name="bob" type="sphere" size="0.1" mass="2" pos="0 0 -0.5"/>
<body name="plate" pos="0.1 0 -0.5"><geom type="box" size="0.02 0.1 0.1" mass="0.5"/></body></body>
</worldbody><actuator><motor joint="pivot" gear="3" ctrlrange="-1 1"/></actuator>
<keyframe><key name="up" qpos="1.5"/></keyframe></mujoco>"""
FALLER = """<mujoco model="faller"><worldbody><body name="a" pos="0 0 3"><freejoint/><geom size="0.1"/>
<body name="b" pos="0 0 -0.5"><joint name="knee" axis="0 1 0"/><geom type="capsule" size="0.05 0.2"/></body></body>
</worldbody></mujoco>"""
PROBLEM = '[simulation]\nduration = 0.1\ndt = 0.01\n\n[[include]]\nfile = "robot.xml"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With a model and a problem that includes it."""
    path = tmp_path_factory.mktemp("clock")
    (path / "robot.xml").write_text(PENDULUM, encoding="utf-8")
    (path / "swing.toml").write_text(PROBLEM, encoding="utf-8")
    return path


def test_the_text_of_a_robot_holds_its_tables_and_findings(folder: Path) -> None:
    robot = read_robot(folder / "robot.xml")
    text = robot_text(robot)
    read = tomllib.loads(text)
    assert read.pop("title") == "a clock"
    assert read.pop("description") == "1 body, 1 joint, 1 motor; 2.5 kg."
    assert read == robot.tables
    head = text.partition("[[body]]")[0]
    assert all(" ".join(finding.what.split()) in " ".join(head.replace("#", "").split()) for finding in robot.findings)
    welded = [line for line in head.splitlines()[-2:] if line.startswith("#")]
    assert any("plate" in line for line in welded)  # beside the body that it was welded to
    assert max(map(len, text.splitlines())) <= 120


def test_text_from_a_model_cannot_leave_its_comment() -> None:
    """Names of a model may hold what they like."""
    finding = Finding("left out", 'mesh a\n[solver]\nb = "c', "why\r\n[[body]]")
    robot = Imported(Path("x.xml"), 'a "title"\n[x]', {"body": [{"name": "b", "mass": 1.0}]}, (finding,))
    read = tomllib.loads(robot_text(robot))
    assert read.keys() == {"title", "description", "body"}
    assert read["body"] == [{"name": "b", "mass": 1}]


@pytest.mark.parametrize("value", [0.1, 1 / 3, -2.0, 1e-7, 123456789.123456, 5e22, float("inf"), -float("inf")])
def test_numbers_keep_fifteen_digits(value: float) -> None:
    assert tomllib.loads(f"x = {number(value)}")["x"] == pytest.approx(value, rel=1e-15)


def test_long_values_have_a_line_for_each_entry() -> None:
    points = np.arange(300.0).reshape(100, 3) / 7
    tables: dict[str, Any] = {"body": [{"name": "rock", "shape": {"parts": [{"convex": {"points": points}}]}}]}
    text = robot_text(Imported(Path("x.xml"), "x", tables, ()))
    assert np.allclose(tomllib.loads(text)["body"][0]["shape"]["parts"][0]["convex"]["points"], points, rtol=1e-14)
    assert max(map(len, text.splitlines())) <= 120


def test_an_included_model_is_the_robot(folder: Path) -> None:
    problem = symphys.load(folder / "swing.toml")
    assert [body.name for body in problem.world().bodies] == ["rod"]
    (folder / "apart").mkdir()
    kept = folder / "apart" / "kept.toml"
    kept.write_text(problem.to_toml(), encoding="utf-8")  # run folders have this text, and no model beside it
    again = symphys.load(kept)
    assert again.parameters.keys() == problem.parameters.keys()
    assert all(np.array_equal(again.parameters[key], problem.parameters[key]) for key in problem.parameters)


def test_an_include_says_keyframe_and_prefix(folder: Path) -> None:
    keys = 'keyframe = "up"\nprefix = "my_"\nself_collision = false\n'
    (folder / "up.toml").write_text(PROBLEM + keys, encoding="utf-8")
    problem = symphys.load(folder / "up.toml")
    assert [joint.start for joint in problem.parametric.joints] == [(1.5,)]


@pytest.mark.parametrize(
    ("include", "why"),
    [
        ('file = "robot.xml"\nkeyframe = "down"', "include[0].file: .*robot.xml.*'down'.*up"),
        ('file = "broken.xml"', "include[0].file: .*broken.xml: line 2: .*mismatched tag"),
        ('file = "robot.toml"\nkeyframe = "up"', "include[0].keyframe: is for models of other programs"),
        ('file = "robot.xml"\nbase = "loose"', "include[0].base: .*free"),
        ('file = "robot.xml"\n[[include]]\nfile = "robot.xml"\nprefix = "b"\nkeyframe = "up"', "otherwise than before"),
    ],
)
def test_what_cannot_be_included_is_said_with_its_place(folder: Path, include: str, why: str) -> None:
    (folder / "broken.xml").write_text("<mujoco>\n<a></mujoco>", encoding="utf-8")
    (folder / "robot.toml").write_text('[[body]]\nname = "a"\nmass = 1\n', encoding="utf-8")
    file = folder / "bad.toml"
    file.write_text(f"[simulation]\nduration = 0.1\ndt = 0.01\n[[include]]\n{include}\n", encoding="utf-8")
    with pytest.raises(ProblemError, match=why.replace("[", r"\[").replace("]", r"\]")):
        symphys.load(file)


def test_a_robot_in_python(folder: Path, tmp_path: Path) -> None:
    """Its findings as text and as a table; saved, it is a file to include."""
    robot = symphys.load_robot(folder / "robot.xml", keyframe="up")
    assert robot.title == "a clock"
    assert str(robot).startswith("a clock, ")
    assert "<td>Left out</td>" in robot._repr_html_()
    assert (
        tomllib.loads(robot.save(tmp_path / "robot.toml").read_text(encoding="utf-8"))["body"] == robot.tables["body"]
    )
    problem = robot.problem(0.2, variable=[{"name": "push", "sets": "pivot.command"}])
    assert [variable.name for variable in problem.variables] == ["push"]
    with pytest.raises(ImportProblem, match="no such folder"):
        symphys.load_robot(folder / "robot.xml", assets=[tmp_path / "none"])


def test_a_robot_that_floats_gets_a_ground_below_its_lowest_point(tmp_path: Path) -> None:
    file = tmp_path / "faller.xml"
    file.write_text(FALLER, encoding="utf-8")
    robot = symphys.load_robot(file)
    assert robot.tables.keys() & {"ground", "plane"} == set()
    text = robot.problem().to_toml()
    assert tomllib.loads(text)["ground"]["height"] == pytest.approx(3 - 0.5 - 0.2 - 0.05, abs=1e-12)
    assert "ground" not in tomllib.loads(robot.problem(ground=False).to_toml())


def test_a_process_reads_a_model_once_until_one_of_its_files_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "robot.xml"
    file.write_text(PENDULUM, encoding="utf-8")
    first = read_robot(file)
    first.tables["body"].clear()  # what a caller does with it is the caller's
    with monkeypatch.context() as patched:
        patched.setattr("symphys.importing.robot.read_source", lambda *_: pytest.fail("read again"))
        assert len(read_robot(file).tables["body"]) == 1
    file.write_text(PENDULUM.replace("a clock", "another"), encoding="utf-8")
    assert read_robot(file).title == "another"


def test_the_command_says_what_became_of_the_model_and_writes_it(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "robots" / "clock.toml"
    assert main(["import", str(folder / "robot.xml"), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "a clock, " in told
    assert "Taken over:" in told
    assert tomllib.loads(out.read_text(encoding="utf-8"))["title"] == "a clock"


def test_the_command_refuses_with_a_message(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(folder / "gone.xml")]) == 2
    assert "gone.xml: there is no such file" in capsys.readouterr().err
    assert main(["import", str(folder / "robot.xml"), "--keyframe", "down"]) == 2
    assert "'down'" in capsys.readouterr().err
