"""Files that are broken at random are read, or become a message."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from mutated_files import CHANGES, KINDS, outcome
from mutated_texts import PROBLEM
from mutations import mutated


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
