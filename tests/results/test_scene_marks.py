"""Places that targets and constraints name are found where these are about coordinates of one body or site."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import symphys
from symphys.results.scene import Scene
from symphys.results.scene_of_problem import make_scene

THROW = """
[simulation]
duration = 1.0
dt = 0.01

[ground]
friction = 0.4

[[body]]
name = "ball"
shape = {{ sphere = {{ radius = 0.1 }} }}
position = [0, 0, 1]
mass = 1.0

[[variable]]
name = "throw"
sets = "ball.velocity"

[[{table}]]
name = "there"
value = "{value}"
{more}
"""


def scene_of(folder: Path, table: str, value: str, more: str) -> Scene:
    (folder / "throw.toml").write_text(THROW.format(table=table, value=value, more=more))
    problem = symphys.load(folder / "throw.toml")
    found = make_scene(problem, {"throw": np.zeros((3, 1))})
    again = Scene.from_json(found.to_json())
    assert [mark.name for mark in again.marks] == [mark.name for mark in found.marks]
    return again


@pytest.mark.parametrize(
    ("value", "at"),
    [
        ("ball.position - [1, 2, 3]", [1, 2, 3]),
        ("ball.position[0:2] - [10, 0]", [10, 0, np.nan]),
        ("2 * ball.position[2] - 3", [np.nan, np.nan, 1.5]),
        ("[4 - ball.position[1], ball.position[0]]", [0, 4, np.nan]),
    ],
)
def test_coordinates_that_a_target_asks_for(tmp_path: Path, value: str, at: list[float]) -> None:
    (mark,) = scene_of(tmp_path, "target", value, "tolerance = 0.02").marks
    assert mark.at == pytest.approx(at, nan_ok=True)
    assert mark.name == "there" and mark.tolerance == 0.02 and not mark.limit


@pytest.mark.parametrize(
    "value",
    ["ball.position[0] * ball.position[1]", "ball.velocity", "norm(ball.position)", "ball.position - ball.velocity"],
)
def test_other_targets_have_no_place(tmp_path: Path, value: str) -> None:
    assert scene_of(tmp_path, "target", value, "tolerance = 0.02").marks == ()


def test_planes_of_constraints(tmp_path: Path) -> None:
    marks = scene_of(tmp_path, "constraint", "ball.position[2] - 0.5", 'at = "always"\nlower = -0.1\nupper = 2.5').marks
    assert [mark.at.tolist()[2] for mark in marks] == pytest.approx([0.4, 3.0]) and all(mark.limit for mark in marks)


def test_surfaces_that_may_touch(tmp_path: Path) -> None:
    (contact,) = scene_of(tmp_path, "target", "ball.position", "tolerance = 0.02").contacts
    assert (contact.name, contact.body, contact.other, contact.solid) == ("ball-ground", "ball", "ground", 0)
    assert contact.friction == pytest.approx(0.4)
