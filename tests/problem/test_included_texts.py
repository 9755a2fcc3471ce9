"""The text of a problem holds those of the files that it includes, so that run folders need no others."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds.included import ROBOT

from symphys.cli import main
from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem
from symphys.problem.include import appendix

Load = Callable[..., Problem]


def test_the_text_holds_all_that_is_needed(load_both: Load, tmp_path: Path) -> None:
    """In another folder, where there is no other file, it is the same problem with the same text."""
    problem = load_both()
    copy = tmp_path / "elsewhere" / "problem.toml"
    copy.parent.mkdir()
    copy.write_text(problem.text, encoding="utf-8")
    again = load_problem(copy)
    assert again.text == problem.text
    assert again.world() == problem.world()
    assert tomllib.loads(problem.text)["included"] == [{"file": "parts/robot.toml", "text": ROBOT}]


def test_what_is_kept_goes_before_what_is_there(load_both: Load, tmp_path: Path) -> None:
    copy = tmp_path / "problem.toml"
    copy.write_text(load_both().text, encoding="utf-8")
    (tmp_path / "parts" / "robot.toml").write_text("changed since", encoding="utf-8")
    assert load_problem(copy).parametric.bodies[0].name == "torso"


def test_faults_of_what_is_kept(load_both: Load, tmp_path: Path) -> None:
    copy = tmp_path / "problem.toml"
    text = load_both().text
    for old, new, message in (
        ("mass = 2\n", "mass = -2\n", '^parts/robot.toml: body "torso".mass: must be'),
        ('file = "parts/robot.toml"\ntext', 'file = "parts/other.toml"\ntext', "not among the files kept.*parts/other"),
        ("\ntext =", "\ntxt =", r"included\[0\].txt: unknown key"),
    ):
        assert old in text
        copy.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(ProblemError, match=message):
            load_problem(copy)


TEXT = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]) | st.sampled_from("\n\t\"\\'"))


@settings(deadline=None)
@given(TEXT, TEXT)
def test_any_text_is_kept_as_it_is(file: str, text: str) -> None:
    assert tomllib.loads("a = 1" + appendix({file: text}))["included"] == [{"file": file, "text": text}]


THROW = """
[simulation]
duration = 0.1
dt = 0.02
[[include]]
file = "ball.toml"
[[variable]]
name = "throw"
sets = "ball.velocity"
[[target]]
name = "there"
value = "ball.position"
tolerance = 0.01
"""


@pytest.mark.slow
def test_a_run_keeps_included_files(tmp_path: Path) -> None:
    """The key knows them, so that a changed ball is thrown again; the folder alone is a problem as well."""
    path, ball, out = tmp_path / "throw.toml", tmp_path / "ball.toml", tmp_path / "out"
    path.write_text(THROW, encoding="utf-8")
    command = ["solve", str(path), "--solver", "least_squares", "--out", str(out), "--backend", "casadi"]
    folder = out / "throw" / "least_squares-seed0"
    keys = []
    for mass in (2, 2, 3):
        ball.write_text(f'[[body]]\nname = "ball"\nmass = {mass}\ninertia = 1\n', encoding="utf-8")
        assert main(command) == 0
        keys.append(((folder / "config.json").read_text(), (folder / "result.json").stat().st_mtime_ns))
    assert keys[0] == keys[1]
    assert keys[1][0] != keys[2][0]
    ball.unlink()
    assert load_problem(folder / "problem.toml").parameters["ball.mass"].tolist() == [3]
    assert main(["report", str(folder)]) == 0
    assert main(["export", str(folder / "problem.toml"), "--casadi", str(tmp_path / "casadi")]) == 0
