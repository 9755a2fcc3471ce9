"""Numbers whose differences or squares are not finite are named with file, table and key, wherever they stand."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from mutated_files import CHANGES, KINDS, outcome
from mutated_texts import PROBLEM
from mutations import mutated

from symphys.errors import ProblemError
from symphys.problem import load_problem


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("x = [0, 0.5, 1]", "x = [0, 1e308, -1e308]", 'reference "r".table.x[1]'),
        ("time = [0, 0.1, 0.2]", "time = [-1e308, 0.1, 1e308]", 'reference "r".table.time[0]'),
        ("[[0, 1], [2, 3], [1, 1]]", "[[0, 1], [2, -1e308], [1e308, 1]]", 'terrain "dunes".heights[1][1]'),
        ("origin = [5, 5]", "origin = [5, 1e200]", 'terrain "dunes".origin[1]'),
        ("radius = 0.1 } }\nmass", "radius = 1e200 } }\nmass", 'body "ball".shape.sphere.radius'),
        ("knots = 5", f"knots = 5\nguess = [[1], [1e308], [{-(10**400)}], [0], [0]]", 'variable "push".guess[1][0]'),
        ("position = [0, 0, 1]", "position = [0, 1e308, 1]", 'body "ball".position[1]'),
        ("limits = [-1, 2]", "limits = [-1e308, 1e308]", 'joint "pin".limits[0]'),
        ("numbers = { c = 0.3 }", "numbers = { c = 1e300 }", 'force "wind".numbers.c'),
        ("gravity = [0, 0, -9.81]", "gravity = [0, 0, -1e308]", "world.gravity[2]"),
    ],
)
def test_a_number_that_is_too_large_is_named(tmp_path: Path, old: str, new: str, place: str) -> None:
    assert old in PROBLEM
    file = tmp_path / "edge.toml"
    file.write_text(PROBLEM.replace(old, new, 1))
    with pytest.raises(ProblemError, match=re.escape(f"{file}: {place}: ") + ".* is too large to be computed with"):
        load_problem(file)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_what_changes_within_next_to_no_time_is_named(tmp_path: Path, kind: str) -> None:
    """A slope of 1e308 and more."""
    file = tmp_path / "edge.toml"
    fast = PROBLEM.replace("time = [0, 0.1, 0.2]", "time = [0, 1e-308, 0.2]")
    file.write_text(fast.replace('"cubic"', f'"{kind}"'))
    with pytest.raises(ProblemError, match=r'row 3, column "x": 0 becomes 0.5 within 1e-308 s, too fast'):
        load_problem(file)


@pytest.mark.parametrize(("kind", "count"), [("problem", 25), ("recording", 60)])
def test_broken_files_are_read_or_become_messages(tmp_path: Path, kind: str, count: int) -> None:
    """A few of those that benchmarks/mutated_files.py makes."""
    attempt = KINDS[kind](tmp_path)
    found = {outcome(attempt, kind, number) for number in range(count)}
    assert found == {"read", "message"}


def test_every_change_changes_something() -> None:
    """Else the thousands would be copies of what works."""
    dice, text = random.Random(1), PROBLEM.encode()
    assert all(change(text, dice) != text for change in CHANGES)
    assert len({mutated(text, dice, CHANGES) for _ in range(20)}) > 15
