"""A small valid file, and ways to load changed copies of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from worlds.included import MAIN, ROBOT
from worlds.two_balls import TWO_BALLS

from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem

Load = Callable[..., Problem]
Refused = Callable[..., ProblemError]


@pytest.fixture(scope="session")
def valid() -> str:
    return TWO_BALLS


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """A function that loads a text, by default the valid one, with pairs of old and new pieces."""

    def load(*changes: tuple[str, str], text: str = TWO_BALLS, settings: Mapping[str, object] | None = None) -> Problem:
        for old, new in changes:
            assert text.count(old) >= 1, f"{old!r} is not in the text"
            text = text.replace(old, new, 1)
        path = tmp_path / "example.toml"
        path.write_text(text, encoding="utf-8")
        return load_problem(path, settings or {})

    return load


@pytest.fixture
def refused(load: Load) -> Refused:
    """The error that a changed text raises."""

    def refused(
        *changes: tuple[str, str], text: str = TWO_BALLS, settings: Mapping[str, object] | None = None
    ) -> ProblemError:
        with pytest.raises(ProblemError) as caught:
            load(*changes, text=text, settings=settings)
        return caught.value

    return refused


@pytest.fixture(scope="session")
def names() -> Callable[[ProblemError, str, str], None]:
    """A check that an error names the file, a place, and what a pattern describes."""

    def names(error: ProblemError, where: str, pattern: str) -> None:
        found = [issue.message for issue in error.issues if issue.where == where]
        assert any(re.search(pattern, message) for message in found), str(error)
        assert str(error).startswith(error.file)

    return names


@pytest.fixture
def write_both(tmp_path: Path) -> Callable[..., Path]:
    """Writes the two files, changed, and tells the problem's path."""

    def write(robot: tuple[str, str] = ("", ""), problem: tuple[str, str] = ("", ""), more: str = "") -> Path:
        (tmp_path / "parts").mkdir(exist_ok=True)
        for name, text, (old, new) in (("parts/robot.toml", ROBOT, robot), ("main.toml", MAIN, problem)):
            assert old in text
            (tmp_path / name).write_text(text.replace(old, new, 1) + more * (name == "main.toml"), encoding="utf-8")
        return tmp_path / "main.toml"

    return write


@pytest.fixture
def load_both(write_both: Callable[..., Path]) -> Load:
    """A function that loads them, changed."""

    def load(*, settings: Mapping[str, object] | None = None, **changes: object) -> Problem:
        return load_problem(write_both(**changes), settings or {})

    return load
