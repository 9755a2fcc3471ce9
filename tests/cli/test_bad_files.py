"""Files that cannot be solved: one message, exit code 2, nothing written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]

WORLD = """
[simulation]
duration = 0.2
dt = 0.02
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1]
"""
VARIABLE = """
[[variable]]
name = "throw"
sets = "ball.velocity"
"""
TARGET = """
[[target]]
name = "there"
value = "ball.position"
tolerance = 0.1
"""
COST = """
[[cost]]
name = "height"
value = "ball.position[2]"
"""


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str | bytes], Path]:
    """A problem file of this content."""

    def write(content: str | bytes) -> Path:
        path = tmp_path / "bad.toml"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (WORLD, ["[[variable]]", "[[target]]"]),
        (WORLD + VARIABLE, ["[[target]]"]),
        (WORLD + VARIABLE + "[objective]\ngoal = 1.0\n", ["[[target]]"]),
        (WORLD + TARGET, ["[[variable]]"]),
        (WORLD + COST, ["[[variable]]"]),
    ],
)
@pytest.mark.parametrize("command", ["solve", "check"])
def test_a_file_with_nothing_to_solve_says_what_is_missing(
    run: Run, write: Callable[[str], Path], command: str, text: str, words: list[str]
) -> None:
    code, _, err = run(command, write(text))
    assert code == 2
    assert [word for word in ("[[variable]]", "[[target]]") if word in err] == words
    assert len(err.splitlines()) == len(words)
    assert not Path("reports").exists()


@pytest.mark.parametrize("text", [WORLD, WORLD + VARIABLE, WORLD + TARGET])
def test_a_file_with_nothing_to_solve_is_shown(run: Run, write: Callable[[str], Path], text: str) -> None:
    code, out, _ = run("show", write(text))
    assert code == 0
    assert Path(out.strip()).exists()


def test_what_the_message_says_to_add_makes_it_solvable(run: Run, write: Callable[[str], Path]) -> None:
    path = write(WORLD)
    advice = [line.partition("for instance, ")[2] for line in run("solve", path)[2].splitlines()]
    tables = [line.replace("]] with ", "]]\n").replace(", sets", "\nsets") for line in advice]
    tables = [line.replace(", value", "\nvalue").replace(", tolerance", "\ntolerance") for line in tables]
    path.write_text("\n".join([WORLD, *tables]), encoding="utf-8")
    assert run("solve", path, "--solver", "least_squares")[0] == 0
