"""Problems from names, paths and tables; changed by the names of their tables, and written again."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path

import numpy as np
import pytest
from worlds.thrown import TABLES

import symphys


def test_sources(tmp_path: Path, problem: symphys.Problem) -> None:
    """A shipped name, a path, tables, and a problem itself."""
    path = tmp_path / "ball.toml"
    path.write_text(problem.to_toml(), encoding="utf-8")
    assert symphys.load(path).initial.keys() == problem.initial.keys()
    assert symphys.load(str(path)).name == "ball"
    assert symphys.load("ball_throw").name == "ball_throw"
    assert symphys.load(problem) is problem
    with pytest.raises(symphys.SymphysError, match="ball_throw"):
        symphys.load("ball_thro")


def test_tables_may_hold_arrays(problem: symphys.Problem) -> None:
    tables = copy.deepcopy(TABLES)
    tables["body"][0]["position"] = np.array([0.0, 0.0, 1.0])
    tables["body"][0]["mass"] = np.float64(0.5)
    tables["variable"][0]["guess"] = (1, 0, 0)
    assert symphys.load(tables).identity.count("mass = 0.5") == 1


def test_set_gives_another_problem(problem: symphys.Problem) -> None:
    """By the name of a body or a variable, of a table, or with the kind of table in front."""
    for key, value, name in (
        ("ball.mass", 2.0, "ball.mass"),
        ("body.ball.mass", 2.0, "ball.mass"),
        ("ground.friction", 0.1, "ground.friction"),
    ):
        changed = problem.set(key, value)
        assert float(changed.parameters[name][0]) == value
        assert float(problem.parameters[name][0]) != value
    many = problem.set({"gravity": [0, 0, -1.6], "throw.guess": [1, 2, 3], "simulation.dt": 0.01})
    assert np.array_equal(many.parameters["gravity"], [0, 0, -1.6])
    assert np.array_equal(many.variables[0].guess, [1, 2, 3]) and many.simulation.dt == 0.01
    assert float(many.set("ball.mass", 3).parameters["gravity"][2]) == -1.6


@pytest.mark.parametrize(
    ("key", "said"),
    [("ball.mas", "mass"), ("bal.mass", "ball"), ("there.at", "target and variable"), ("simulation.dtt", "dt")],
)
def test_a_key_that_is_none_is_named(key: str, said: str) -> None:
    tables = copy.deepcopy(TABLES)
    tables["variable"][0]["name"] = "there"
    with pytest.raises(symphys.ProblemError, match=said):
        symphys.load(tables).set(key, 1)


def test_what_is_written_is_the_problem(problem: symphys.Problem, tmp_path: Path) -> None:
    """Its own text with its comments, and a table [set]; also of one that has the table already."""
    changed = symphys.load("ball_throw").set("ball.mass", 2.0)
    text = changed.to_toml()
    assert text.startswith(symphys.load("ball_throw").text.rstrip()) and tomllib.loads(text)["set"] == {"ball.mass": 2}
    path = tmp_path / "again.toml"
    path.write_text(text, encoding="utf-8")
    again = symphys.load(path).set("ground.friction", 0.25)
    path.write_text(again.to_toml(), encoding="utf-8")
    last = symphys.load(path)
    assert (float(last.parameters["ball.mass"][0]), float(last.parameters["ground.friction"][0])) == (2.0, 0.25)


@pytest.mark.slow
def test_a_robot_is_changed_by_its_own_names() -> None:
    """What an included file says is set like the problem's own, and written with it."""
    changed = symphys.load("quadruped_walk").set("torso.mass", 3.0)
    again = symphys.load(tomllib.loads(changed.to_toml()))
    assert float(again.parameters["torso.mass"][0]) == 3.0


def test_settings_in_a_file_must_be_a_table(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text("set = 3\n" + symphys.load("ball_throw").text, encoding="utf-8")
    with pytest.raises(symphys.ProblemError, match=r'set: .*"body.ball.mass" = 2'):
        symphys.load(path)
