"""Broken models become a robot or a message; benchmarks/mutated_robots.py tries thousands."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from mutated_robots import CHANGES
from mutated_texts import MODELS
from mutations import mutated
from tools.repeats import few

from symphys.errors import SymphysError
from symphys.importing.records import Finding
from symphys.importing.robot import read_robot

pytest.importorskip("mujoco")

CASES = 6


@pytest.mark.slow
@few("name", MODELS, 1)
def test_a_broken_model_is_a_robot_or_a_message(tmp_path: Path, name: str) -> None:
    dice, seen = random.Random(7), set[bool]()
    for text in (MODELS[name], *(mutated(MODELS[name], dice, CHANGES) for _ in range(CASES))):
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
