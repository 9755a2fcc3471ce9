"""Models of robots that are broken at random become a robot or a message."""

from __future__ import annotations

import random
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

import pytest
from data.mutated_texts import MODELS
from tools.mutations import MODEL_CHANGES, mutated
from tools.repeats import few

import symphys
from symphys.errors import SymphysError
from symphys.importing.records import Finding
from symphys.importing.robot import read_robot

pytest.importorskip("mujoco")

CASES = 6
MOST_BODIES = 6
"""Larger robots are read, and make no problem: that takes many seconds."""


@pytest.mark.slow
@few("name", MODELS, 1)
def test_a_broken_model_is_a_robot_or_a_message(tmp_path: Path, name: str) -> None:
    dice, seen = random.Random(7), set[bool]()
    for text in (MODELS[name], *(mutated(MODELS[name], dice, MODEL_CHANGES) for _ in range(CASES))):
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


@pytest.mark.thorough
def test_broken_models_of_packages_are_robots_or_messages(tmp_path: Path) -> None:
    """Of gymnasium and dm_control, as far as they are installed; small robots become problems too."""
    places = (("gymnasium", "envs/mujoco/assets"), ("dm_control", "suite"))
    found = [(spec, below) for package, below in places if (spec := find_spec(package)) and spec.origin]
    models = [path for spec, below in found for path in sorted((Path(str(spec.origin)).parent / below).glob("*.xml"))]
    if not models:
        pytest.skip("neither gymnasium nor dm_control is installed")
    dice = random.Random(1)
    for number in range(300):
        path = dice.choice(models)
        file = tmp_path / f"{number}-{path.name}"
        file.write_bytes(mutated(path.read_bytes(), dice, MODEL_CHANGES))
        try:
            robot = symphys.load_robot(file, self_collision=False)
        except SymphysError as error:
            assert str(error).startswith(f"{file}: ") and "\n  File" not in str(error)
            continue
        robot.text()
        if len(robot.tables["body"]) <= MOST_BODIES:
            with suppress(SymphysError):
                robot.problem()


@pytest.mark.parametrize("change", MODEL_CHANGES)
def test_every_change_changes_something(change: object) -> None:
    """Else the thousands would be copies of what works."""
    dice = random.Random(1)
    assert callable(change)
    assert any(change(MODELS["robot.urdf"], dice) != MODELS["robot.urdf"] for _ in range(3))
