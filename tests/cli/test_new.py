"""A copy to begin with works at once; what is shipped can be read and looked at, robots too."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tools.repeats import few

from symphys import problems

Run = Callable[..., tuple[int, str, str]]


@few("name", ["ball_throw", "cart_pole"], 1)
def test_a_copy_is_the_problem(run: Run, name: str) -> None:
    """Comments and all; what it includes is found from elsewhere."""
    code, out, _ = run("new", "mine.toml", "--from", name)
    assert code == 0 and "symphys solve mine.toml" in out
    assert Path("mine.toml").read_text(encoding="utf-8") == problems.find(name).read_text(encoding="utf-8")
    assert run("show", "mine.toml")[0] == 0


@pytest.mark.slow
def test_a_robot_is_to_be_included(run: Run) -> None:
    code, out, _ = run("new", "leg.toml", "--from", "hopper")
    assert code == 0 and 'file = "leg.toml"' in out
    head = "[simulation]\nduration = 0.1\ndt = 0.01\n[[include]]\nfile = 'leg.toml'\n"
    Path("world.toml").write_text(head, encoding="utf-8")
    assert run("show", "world.toml")[0] == 0


def test_nothing_is_overwritten(run: Run) -> None:
    Path("mine.toml").write_text("mine", encoding="utf-8")
    code, _, err = run("new", "mine.toml")
    assert code == 2 and "mine.toml" in err and "not overwritten" in err
    assert Path("mine.toml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("command", [("new", "a.toml", "--from"), ("show", "--text"), ("show",)])
def test_a_name_that_is_none(run: Run, command: tuple[str, ...]) -> None:
    code, _, err = run(*command, "ball_thro")
    assert code == 2 and "ball_throw" in err


def test_the_text_of_what_is_shipped(run: Run) -> None:
    for name, path in (("ball_throw", problems.find("ball_throw")), ("arm", problems.parts()["robots/arm.toml"])):
        code, out, _ = run("show", name, "--text")
        assert (code, out) == (0, path.read_text(encoding="utf-8"))


@pytest.mark.slow
@few("robot", ["robots/arm.toml", "hopper", "cart_pendulum"], 1)
def test_a_robot_alone(run: Run, robot: str) -> None:
    code, out, _ = run("show", robot, "--set", "simulation.duration=0.1")
    assert code == 0 and Path(out.strip()).is_file()


@pytest.mark.slow
def test_a_robot_of_mujoco_is_shown_with_what_was_lost(run: Run) -> None:
    pytest.importorskip("mujoco")
    joint = '<joint name="hip" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>'
    body = f'<body name="arm" pos="0 0 1">{joint}</body><light pos="0 0 3"/>'
    Path("arm.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>", encoding="utf-8")
    code, out, err = run("show", "arm.xml", "--set", "simulation.duration=0.1", "--no-self-collision")
    assert code == 0 and Path(out.strip()).is_file()
    assert "left out; symphys import arm.xml names them" in err
    code, _, err = run("show", "arm.xml", "--keyframe", "home")
    assert code == 2 and "home" in err and "arm.xml" in err


@pytest.mark.slow
def test_a_robot_of_an_installed_package_is_shown(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    package = tmp_path / "site" / "toy_robots"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    joint = '<joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>'
    body = f'<body name="arm" pos="0 0 1">{joint}</body>'
    (package / "arm.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>", encoding="utf-8")
    monkeypatch.syspath_prepend(package.parent)
    code, out, _ = run("show", "package://toy_robots/arm.xml", "--set", "simulation.duration=0.1")
    assert code == 0 and Path(out.strip()).is_file()
    code, _, err = run("show", "package://toy_robots/leg.xml")
    assert code == 2 and "no such file" in err


def test_choices_for_robots_are_none_of_problems(run: Run) -> None:
    code, _, err = run("show", "ball_throw", "--base", "free")
    assert code == 2 and "base: for robots alone" in err
